// A browser and a server for tests: node's own server, Debian's Chromium.

import { createServer } from "node:http";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { extname, join, normalize } from "node:path";
import { chromium } from "playwright-core";

const TYPES = {
  ".html": "text/html; charset=utf-8", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm", ".glsl": "text/plain; charset=utf-8",
};

/** Serves a folder, as static hosts do: no headers that isolate the page. */
export async function serve(folder) {
  const server = createServer(async (request, response) => {
    const path = normalize(decodeURIComponent(new URL(request.url, "http://here").pathname));
    const file = join(folder, path.endsWith("/") ? `${path}index.html` : path);
    try {
      const body = await readFile(file);
      response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream" }).end(body);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { url: `http://127.0.0.1:${server.address().port}/`, close: () => server.close() };
}

/** What anything may take (ms), on a machine that does other things, too. */
export const PATIENCE = 180_000;

/** Chromium by itself: SwiftShader draws, nothing is fetched that nobody asked for. */
export async function browse(work, options = {}) {
  const profile = await mkdtemp(join(tmpdir(), "fogbow-browser-"));
  const browser = await chromium.launchPersistentContext(profile, {
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    headless: true,
    timeout: PATIENCE,
    args: [
      "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
      "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
      "--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader",
    ],
    viewport: { width: 1280, height: 800 },
    ...options,
  });
  browser.setDefaultTimeout(PATIENCE);
  try {
    return await work(browser);
  } finally {
    await browser.close();
    await rm(profile, { recursive: true, force: true, maxRetries: 5 });
  }
}

/** A page that notes what it should not do: errors, and requests to elsewhere. */
export async function watched(browser, url) {
  const page = await browser.newPage();
  const wrong = [];
  page.on("console", (message) => {
    // Of the software that draws here: reading what was drawn takes time.
    if (/GPU stall due to ReadPixels/.test(message.text())) return;
    // Browsers ask for it by themselves where no page says what its icon is.
    if (message.location().url.endsWith("/favicon.ico")) return;
    if (message.type() === "error" || message.type() === "warning") wrong.push(`console: ${message.text()}`);
  });
  page.on("pageerror", (error) => wrong.push(`error: ${error.stack ?? error}`));
  page.on("request", (request) => {
    if (!request.url().startsWith(url) && !/^(data|blob):/.test(request.url())) wrong.push(`outside request: ${request.url()}`);
  });
  page.on("response", (response) => {
    if (response.status() >= 400 && !response.url().endsWith("/favicon.ico")) wrong.push(`${response.status()}: ${response.url()}`);
  });
  return { page, wrong };
}

/** An empty page of the same origin, that may import /asked.mjs. */
export async function asking(browser, url) {
  const { page, wrong } = await watched(browser, url);
  const asked = await readFile(new URL("asked.mjs", import.meta.url), "utf8");
  await page.route("**/asked.mjs", (route) => route.fulfill({ contentType: "text/javascript", body: asked }));
  await page.route("**/empty.html", (route) => route.fulfill({ contentType: "text/html", body: "" }));
  await page.goto(`${url}empty.html`);
  return { page, wrong };
}
