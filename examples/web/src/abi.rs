//! What JavaScript calls. Numbers go in as arguments, all else through one buffer; what comes back lies in another. A function that fails
//! answers [`FAILED`] and leaves a message. Objects are named by handles, which JavaScript gives back.
#![expect(
    unsafe_code,
    reason = "names of exports, and state that is shared by calls of which there is never more than one at a time"
)]

use alloc::string::String;
use alloc::vec::Vec;
use core::cell::RefCell;

use fogbow::math::Bounds;
use fogbow::spectrum::Spectrum;

use super::caches::WebCaches;
use super::mathematics;
use super::probes::WebProbes;
use super::view::{Part, Rays, View};
use super::words::{Fault, Words};
use super::world::WebWorld;

#[cfg(target_family = "wasm")]
#[global_allocator]
static MEMORY: dlmalloc::GlobalDlmalloc = dlmalloc::GlobalDlmalloc;

/// Says that a call failed.
pub const FAILED: u32 = u32::MAX;

/// Changes with what is exported and with how worlds are described.
const VERSION: u32 = 1;

/// What outlives a call.
struct State {
    worlds: Objects<WebWorld>,
    caches: Objects<WebCaches>,
    probes: Objects<WebProbes>,
    /// Words for the alignment; bytes are written into them, too.
    input: Vec<u32>,
    output: Vec<u32>,
    output_bytes: usize,
    message: String,
}

struct Shared(RefCell<State>);

// SAFETY: a module of WebAssembly without shared memory has one thread; the native build of this file is linked and never called.
unsafe impl Sync for Shared {}

static STATE: Shared = Shared(RefCell::new(State {
    worlds: Objects(Vec::new()),
    caches: Objects(Vec::new()),
    probes: Objects(Vec::new()),
    input: Vec::new(),
    output: Vec::new(),
    output_bytes: 0,
    message: String::new(),
}));

/// Objects by handle: a place in the list.
struct Objects<T>(Vec<Option<T>>);

impl<T> Objects<T> {
    fn add(&mut self, object: T) -> u32 {
        let free = self.0.iter().position(Option::is_none).unwrap_or(self.0.len());
        match self.0.get_mut(free) {
            Some(place) => *place = Some(object),
            None => self.0.push(Some(object)),
        }
        free as u32
    }

    fn get(&self, handle: u32) -> Result<&T, Fault> {
        self.0.get(handle as usize).and_then(Option::as_ref).ok_or_else(gone)
    }

    fn get_mut(&mut self, handle: u32) -> Result<&mut T, Fault> {
        self.0.get_mut(handle as usize).and_then(Option::as_mut).ok_or_else(gone)
    }

    fn remove(&mut self, handle: u32) {
        if let Some(place) = self.0.get_mut(handle as usize) {
            *place = None;
        }
    }
}

fn gone() -> Fault {
    Fault::new("the object has been freed")
}

impl State {
    fn words(&mut self, words: &[u32]) {
        self.output.clear();
        self.output.extend_from_slice(words);
        self.output_bytes = 4 * words.len();
    }

    fn bytes(&mut self, bytes: &[u8]) {
        self.output.clear();
        self.output.resize(bytes.len().div_ceil(4), 0);
        bytemuck::cast_slice_mut(&mut self.output)[..bytes.len()].copy_from_slice(bytes);
        self.output_bytes = bytes.len();
    }

    fn colours(&mut self, colours: &[Spectrum]) {
        self.words(bytemuck::cast_slice(colours));
    }

    /// The first bytes of the input.
    fn input_bytes(&self, count: u32) -> Result<&[u8], Fault> {
        bytemuck::cast_slice(&self.input).get(..count as usize).ok_or_else(|| Fault::new("the input is too short"))
    }
}

/// Runs a call, and turns what fails into a message.
fn call(work: impl FnOnce(&mut State) -> Result<u32, Fault>) -> u32 {
    let Ok(mut state) = STATE.0.try_borrow_mut() else { return FAILED };
    match work(&mut state) {
        Ok(answer) => answer,
        Err(Fault(message)) => {
            state.message = message;
            FAILED
        }
    }
}

macro_rules! exports {
    ($($(#[doc = $doc:literal])+ $name:ident($($argument:ident),*) -> $state:ident $body:block)+) => {
        $(
            $(#[doc = $doc])+
            // SAFETY: no other symbol of this module is called so.
            #[unsafe(no_mangle)]
            pub extern "C" fn $name($($argument: u32),*) -> u32 {
                call(|$state| $body)
            }
        )+
    };
}

exports! {
    /// Version of this interface.
    fogbow_abi_version() -> _state { Ok(VERSION) }

    /// Where so many bytes of input are to be written.
    fogbow_input(bytes) -> state {
        state.input.clear();
        state.input.resize((bytes as usize).div_ceil(4), 0);
        Ok(address(&state.input))
    }

    /// Where the output of the last call lies.
    fogbow_output() -> state { Ok(address(&state.output)) }

    /// How many bytes it has.
    fogbow_output_length() -> state { Ok(state.output_bytes as u32) }

    /// Puts the message of the last failure to the output.
    fogbow_message() -> state {
        let message = core::mem::take(&mut state.message);
        state.bytes(message.as_bytes());
        Ok(0)
    }

    /// Gives back the memory of input and output.
    fogbow_trim() -> state {
        (state.input, state.output, state.output_bytes) = (Vec::new(), Vec::new(), 0);
        Ok(0)
    }

    /// A world from its description.
    world_new() -> state {
        let world = WebWorld::new(&state.input)?;
        Ok(state.worlds.add(world))
    }

    /// Frees a world.
    world_free(handle) -> state { state.worlds.remove(handle); Ok(0) }

    /// The box around what matters: six floats.
    world_bounds(handle) -> state {
        let Bounds { min, max } = state.worlds.get(handle)?.bounds();
        state.words(bytemuck::cast_slice(&[min.to_array(), max.to_array()]));
        Ok(0)
    }

    /// Path-traced radiance of a part of a picture: input view and part, output three floats for each pixel.
    world_picture(handle) -> state {
        let mut words = Words::new(&state.input);
        let (view, part) = (View::read(&mut words)?, Part::read(&mut words)?);
        let picture = state.worlds.get(handle)?.path_trace(&view, &part)?;
        state.colours(&picture);
        Ok(0)
    }

    /// Path-traced radiance of rays.
    world_radiance(handle, samples, seed) -> state {
        let light = state.worlds.get(handle)?.radiance(Rays::read(&state.input)?, samples, u64::from(seed));
        state.colours(&light);
        Ok(0)
    }

    /// Path-traced light scattered at points towards directions.
    world_in_scattered(handle, samples, seed) -> state {
        let light = state.worlds.get(handle)?.in_scattered(&state.input, samples, u64::from(seed))?;
        state.colours(&light);
        Ok(0)
    }

    /// Light of lights scattered once, at points towards directions.
    world_scattered_once(handle) -> state {
        let light = mathematics::scattered_once(state.worlds.get(handle)?, &state.input)?;
        state.colours(&light);
        Ok(0)
    }

    /// A record of light scattered once: 16 floats.
    world_record(handle) -> state {
        let record = mathematics::record(state.worlds.get(handle)?, &state.input)?;
        state.words(bytemuck::cast_slice(&[record]));
        Ok(0)
    }

    /// A covariance grid.
    world_covariances(handle) -> state {
        let grid = mathematics::covariances(state.worlds.get(handle)?, &state.input)?;
        state.words(&grid);
        Ok(0)
    }

    /// A virtual light's clamped light, and all of it, at points.
    world_virtual_light(handle) -> state {
        let light = mathematics::virtual_light(state.worlds.get(handle)?, &state.input)?;
        state.colours(&light);
        Ok(0)
    }

    /// Empty caches.
    caches_new(world) -> state {
        let caches = WebCaches::new(state.worlds.get(world)?, &state.input)?;
        Ok(state.caches.add(caches))
    }

    /// Frees caches.
    caches_free(handle) -> state { state.caches.remove(handle); Ok(0) }

    /// Asks for light elsewhere.
    caches_ask(handle) -> state { state.caches.get_mut(handle)?.ask(&state.input)?; Ok(0) }

    /// Runs so many jobs; 1 if more are due.
    caches_fill(handle, world, jobs) -> state {
        let more = state.caches.get_mut(handle)?.fill(state.worlds.get(world)?, jobs);
        Ok(u32::from(more))
    }

    /// Ends a fill where it is.
    caches_stop(handle) -> state { state.caches.get_mut(handle)?.stop(); Ok(0) }

    /// Two integers: the next job of this round, and the end of the round.
    caches_jobs(handle) -> state {
        let jobs = state.caches.get(handle)?.jobs();
        state.words(&jobs);
        Ok(0)
    }

    /// What is being done, in words.
    caches_stage(handle) -> state {
        let stage = state.caches.get(handle)?.stage();
        state.bytes(stage.as_bytes());
        Ok(0)
    }

    /// Runs a job; the output is what it leaves.
    caches_run(handle, world, job) -> state {
        let left = state.caches.get_mut(handle)?.run(state.worlds.get(world)?, job);
        state.bytes(&left);
        Ok(0)
    }

    /// Takes what the next job has left, from so many bytes of input.
    caches_accept(handle, bytes) -> state {
        let left = state.input_bytes(bytes)?.to_vec();
        state.caches.get_mut(handle)?.accept(&left)?;
        Ok(0)
    }

    /// Radiance of a part of a picture, from caches.
    caches_picture(handle, world) -> state {
        let mut words = Words::new(&state.input);
        let (view, part) = (View::read(&mut words)?, Part::read(&mut words)?);
        let picture = state.caches.get(handle)?.picture(state.worlds.get(world)?, &view, &part)?;
        state.colours(&picture);
        Ok(0)
    }

    /// Radiance of rays, from caches.
    caches_radiance(handle, world, samples, seed) -> state {
        let rays = Rays::read(&state.input)?;
        let light = state.caches.get(handle)?.radiance(state.worlds.get(world)?, rays, samples, u64::from(seed))?;
        state.colours(&light);
        Ok(0)
    }

    /// Light scattered at points towards directions, from caches.
    caches_in_scattered(handle, world, seed) -> state {
        let light = state.caches.get(handle)?.in_scattered(state.worlds.get(world)?, &state.input, u64::from(seed))?;
        state.colours(&light);
        Ok(0)
    }

    /// Records of a kind.
    caches_records(handle, kind) -> state {
        let records = state.caches.get(handle)?.records(kind)?.to_vec();
        state.bytes(&records);
        Ok(0)
    }

    /// Caches as bytes.
    caches_save(handle) -> state {
        let bytes = state.caches.get(handle)?.save()?;
        state.bytes(&bytes);
        Ok(0)
    }

    /// Caches from so many bytes of input.
    caches_load(handle, bytes) -> state {
        let bytes = state.input_bytes(bytes)?.to_vec();
        state.caches.get_mut(handle)?.load(&bytes)?;
        Ok(0)
    }

    /// Probes of which nothing is known.
    probes_new(world) -> state {
        let probes = WebProbes::new(state.worlds.get(world)?, &state.input)?;
        Ok(state.probes.add(probes))
    }

    /// Frees probes.
    probes_free(handle) -> state { state.probes.remove(handle); Ok(0) }

    /// Runs so many jobs, with what caches know if their handle is one; 1 if more are due.
    probes_bake(handle, world, caches, jobs) -> state {
        let caches = if caches == FAILED { None } else { Some(state.caches.get(caches)?) };
        Ok(u32::from(state.probes.get_mut(handle)?.bake(state.worlds.get(world)?, caches, jobs)?))
    }

    /// Two integers: the next job of this round, and the end of the round.
    probes_jobs(handle) -> state {
        let jobs = state.probes.get(handle)?.jobs();
        state.words(&jobs);
        Ok(0)
    }

    /// Runs a job; the output is what it leaves.
    probes_run(handle, world, caches, job) -> state {
        let caches = if caches == FAILED { None } else { Some(state.caches.get(caches)?) };
        let left = state.probes.get_mut(handle)?.run(state.worlds.get(world)?, caches, job)?;
        state.bytes(&left);
        Ok(0)
    }

    /// Takes what the next job has left, from so many bytes of input.
    probes_accept(handle, bytes) -> state {
        let left = state.input_bytes(bytes)?.to_vec();
        state.probes.get_mut(handle)?.accept(&left)?;
        Ok(0)
    }

    /// Bakes anew what has a part in a box: six floats.
    probes_bake_anew(handle) -> state {
        let mut words = Words::new(&state.input);
        let bounds = Bounds { min: words.vector()?, max: words.vector()? };
        state.probes.get_mut(handle)?.bake_anew(bounds)?;
        Ok(0)
    }

    /// Two floats: relative standard error, share of the work that is done.
    probes_progress(handle) -> state {
        let probes = state.probes.get(handle)?;
        let progress = [probes.error()?, probes.share()].map(f32::to_bits);
        state.words(&progress);
        Ok(0)
    }

    /// Light at points in directions.
    probes_values(handle) -> state {
        let light = state.probes.get(handle)?.values(&state.input)?;
        state.colours(&light);
        Ok(0)
    }

    /// 3D textures: four floats for each probe, number after number, then the medium. Light spreads into invalid probes unless the last is 0.
    probes_textures(handle, is_dilated) -> state {
        let textures = state.probes.get(handle)?.textures(is_dilated != 0)?;
        state.words(bytemuck::cast_slice(&textures));
        Ok(0)
    }

    /// Probes as bytes.
    probes_save(handle) -> state {
        let bytes = state.probes.get(handle)?.save()?;
        state.bytes(&bytes);
        Ok(0)
    }

    /// Probes from so many bytes of input.
    probes_load(handle, bytes) -> state {
        let bytes = state.input_bytes(bytes)?.to_vec();
        state.probes.get_mut(handle)?.load(&bytes)?;
        Ok(0)
    }
}

/// Where memory begins; the addresses of WebAssembly have 32 bits.
fn address(memory: &[u32]) -> u32 {
    memory.as_ptr().addr() as u32
}

/// Panics are bugs of the library, and end the module: the package says so. They are compiled without words, which would be 4 % of it.
#[cfg(target_family = "wasm")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    core::arch::wasm32::unreachable()
}
