// An engine's job system fills caches, bakes probes and audits: the same bits for any number of threads and any order.
//   c++ -std=c++17 -O2 jobs.cpp $(pkg-config --cflags --libs fogbow) -pthread && ./a.out
#include <fogbow.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <mutex>
#include <random>
#include <thread>

// Runs functions on threads of its own.
class JobSystem {
public:
    explicit JobSystem(unsigned threads) : threads_(threads) {}

    // Runs all jobs of all rounds: each thread takes the next one, runs it and gives its result back.
    void finish(const fogbow::Work &work, unsigned shuffle) {
        std::mt19937 order(shuffle);
        for (auto due = work.jobs(); due.first < due.second; due = work.jobs()) {
            std::vector<std::uint32_t> jobs;
            for (auto job = due.first; job < due.second; job++) jobs.push_back(job);
            if (shuffle) std::shuffle(jobs.begin(), jobs.end(), order);
            // Some are left: the level is unloaded, the game is quit. They are asked for again.
            if (shuffle && jobs.size() > 8) jobs.resize(jobs.size() - 3);
            std::atomic<std::size_t> next{0};
            std::exception_ptr wrong;
            std::mutex mutex;
            auto worker = [&] {
                try {
                    for (auto i = next++; i < jobs.size(); i = next++) work.accept(work.run(jobs[i]));
                } catch (...) {
                    std::lock_guard<std::mutex> lock(mutex);
                    wrong = std::current_exception();
                }
            };
            std::vector<std::thread> threads;
            for (unsigned i = 0; i < threads_; i++) threads.emplace_back(worker);
            for (auto &thread : threads) thread.join();
            if (wrong) std::rethrow_exception(wrong);
        }
    }

private:
    unsigned threads_;
};

// A room of boxes: the nearest wall, seen from within.
static std::optional<fogbow_hit> closest_hit(const fogbow_ray &ray) {
    fogbow_hit hit{};
    hit.distance = INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        const float side = ray.direction[axis] < 0 ? -1.0f : 1.0f;
        const float t = (side - ray.origin[axis]) / ray.direction[axis];
        if (!(t >= 0 && t < hit.distance)) continue;
        hit.distance = t;
        for (int k = 0; k < 3; k++) hit.normal[k] = k == axis ? -side : 0;
        for (int k = 0; k < 3; k++) hit.reflectance[k] = axis == 0 && k == 0 ? 0.7f : 0.4f;
    }
    if (!(hit.distance < ray.length)) return std::nullopt;
    hit.surface = FOGBOW_SURFACE_LAMBERT;
    hit.light = FOGBOW_NO_LIGHT;
    return hit;
}

int main() try {
    const fogbow_box box{{-1, -1, -1}, {1, 1, 1}};
    fogbow_properties smoke{};
    for (float &c : smoke.absorption) c = 0.1f;
    for (float &c : smoke.scattering) c = 0.6f;
    // Thicker below: eight cells.
    const std::vector<float> densities{1.5f, 1.5f, 0.5f, 0.5f, 1.5f, 1.5f, 0.5f, 0.5f};
    fogbow_light lamp{};
    lamp.kind = FOGBOW_LIGHT_POINT;
    lamp.position[1] = 0.5f;
    for (float &c : lamp.emission) c = 3;
    const fogbow::World world(fogbow::Medium::grid({2, 2, 2}, densities, smoke, box), closest_hit, {lamp}, box);

    // Rougher than usual, so that this is quick.
    auto settings = fogbow::make<fogbow_settings>();
    settings.error = 0.1f;
    settings.rays = 64;
    settings.walks = 16;
    const fogbow_camera camera{{0, 0, 0.9f}, {0, 0, 0}, {0, 1, 0}, 1.2f, 1};
    auto view = fogbow::make<fogbow_view>();
    view.pixel = 0.02f;
    view.context = &camera;
    view.ray = fogbow_camera_ray;
    auto baked = fogbow::make<fogbow_bake_settings>();
    for (auto &count : baked.counts) count = 8;
    baked.most_passes = 2;

    std::vector<std::vector<unsigned char>> results;
    for (const unsigned threads : {1u, 2u, 4u}) {
        JobSystem jobs(threads);
        fogbow::Caches caches(world, settings);
        {
            const auto fill = caches.fill(view);
            jobs.finish(fill, threads > 1 ? threads : 0);
        }
        auto bytes = caches.save(1);
        const auto bake = fogbow::Probes::bake(world, baked);
        jobs.finish(bake, threads > 1 ? threads : 0);
        const auto probes = fogbow::Probes::of(bake);
        const auto saved = probes.save(1);
        const auto audit = caches.audit(view, 256);
        jobs.finish(audit, threads > 1 ? threads : 0);
        auto found = fogbow::make<fogbow_findings>();
        fogbow::check(fogbow_audit_findings(audit.get(), &found));
        std::printf("%u threads: %zu bytes of caches, %zu of probes, off by %.3f +- %.3f\n", threads, bytes.size(), saved.size(),
                    found.cached.bias, found.cached.error);
        bytes.insert(bytes.end(), saved.begin(), saved.end());
        const auto *numbers = reinterpret_cast<const unsigned char *>(&found.all);
        bytes.insert(bytes.end(), numbers, numbers + sizeof found.all);
        results.push_back(std::move(bytes));
    }
    if (results[0] != results[1] || results[0] != results[2]) throw std::runtime_error("other bits with other threads");
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}
