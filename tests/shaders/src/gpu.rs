//! The shader at work.

use bytemuck::{Pod, Zeroable};
use fogbow::bake::{Probe, ProbeGrid, ProbeLevels, ProbeState};
use half::f16;
use wgpu::util::{BufferInitDescriptor, DeviceExt, TextureDataOrder};
use wgpu::{
    BindGroupDescriptor, BindGroupEntry, BindingResource, BufferDescriptor, BufferUsages, ComputePipelineDescriptor,
    DeviceDescriptor, Extent3d, Instance, InstanceDescriptor, MapMode, PollType, ShaderModuleDescriptor, ShaderSource,
    TextureDescriptor, TextureDimension, TextureFormat, TextureUsages,
};

use crate::STEPS;

const FOG: &str = include_str!("../../../examples/shaders/fog.wgsl");

/// Numbers of a probe that the shader knows.
const NUMBERS: usize = 9;

const GROUP: u32 = 64;

/// What is asked of the shader: light at a point towards a direction, and fog along the ray.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub struct Question {
    pub point: [f32; 3],
    pub depth: f32,
    pub direction: [f32; 3],
    pub padding: f32,
}

#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Probes {
    corner: [f32; 3],
    scale: f32,
    size: [f32; 3],
    numbers: u32,
    counts: [u32; 3],
    levels: u32,
}

/// Texels along a side of a brick of a finer level.
const BRICK: u32 = 4;

/// An atlas: the probes of all cells, above them in z the bricks of finer levels, one on the other. What `of` says of each probe, colour and alpha.
fn atlas(levels: &ProbeLevels<'_>, of: impl Fn(&ProbeGrid<'_>, usize) -> ([f32; 3], f32)) -> ([u32; 3], Vec<f16>) {
    let [grid, finer @ ..] = levels.levels() else { return ([0; 3], Vec::new()) };
    let [nx, ny, nz] = grid.lattice().size();
    let bricks: usize = finer.iter().map(|grid| grid.places().len()).sum();
    let size = if bricks == 0 { [nx, ny, nz] } else { [nx.max(BRICK), ny.max(BRICK), nz + BRICK * bricks as u32] };
    let mut all = vec![([0.0; 3], 0.0); size.iter().product::<u32>() as usize];
    let mut put = |[x, y, z]: [u32; 3], texel| all[(x + size[0] * (y + size[1] * z)) as usize] = texel;
    for index in 0..grid.probes().len() {
        let i = index as u32;
        put([i % nx, i / nx % ny, i / (nx * ny)], of(grid, index));
    }
    let mut first = nz;
    for grid in finer {
        for index in 0..grid.probes().len() {
            let i = index as u32;
            put([i % BRICK, i / BRICK % BRICK, first + i / (BRICK * BRICK)], of(grid, index));
        }
        first += BRICK * grid.places().len() as u32;
    }
    (size, texels(all.into_iter()))
}

/// Where each brick of each finer level begins; one texel without finer levels.
fn index(levels: &ProbeLevels<'_>) -> ([u32; 3], Vec<f16>) {
    let [grid, finer @ ..] = levels.levels() else { return ([0; 3], Vec::new()) };
    let places = |grid: &ProbeGrid<'_>| grid.lattice().size().map(|n| n.div_ceil(BRICK));
    let most = |axis: usize| finer.iter().map(|grid| places(grid)[axis]).max().unwrap_or(1);
    let size = [most(0), most(1), finer.iter().map(|grid| places(grid)[2]).sum::<u32>().max(1)];
    let mut all = vec![([0.0; 3], 0.0); size.iter().product::<u32>() as usize];
    let (mut first, mut layer) = (grid.lattice().size()[2], 0);
    for grid in finer {
        let [px, py, pz] = places(grid);
        for place in grid.places() {
            let [x, y, z] = [place % px, place / px % py, place / (px * py) + layer];
            all[(x + size[0] * (y + size[1] * z)) as usize] = ([0.0, 0.0, first as f32], 1.0);
            first += BRICK;
        }
        layer += pz;
    }
    (size, texels(all.into_iter()))
}

/// As `fogbow bake` writes them: half floats, colour and what is in alpha.
fn texels(colours: impl Iterator<Item = ([f32; 3], f32)>) -> Vec<f16> {
    colours.flat_map(|([r, g, b], alpha)| [r, g, b, alpha]).map(f16::from_f32).collect()
}

/// Two answers to each question: light in alpha nothing, and fog with transmittance in alpha.
pub fn answers(levels: &ProbeLevels<'_>, questions: &[Question]) -> Result<Vec<[f32; 4]>, Box<dyn std::error::Error>> {
    let instance = Instance::new(InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))
        .map_err(|error| format!("no graphics: {error}; Debian's mesa-vulkan-drivers has a driver in software"))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&DeviceDescriptor::default()))?;
    let source = format!(
        "{FOG}
        struct Question {{ point: vec3<f32>, depth: f32, direction: vec3<f32>, padding: f32 }}
        @group(1) @binding(0) var<storage, read> questions: array<Question>;
        @group(1) @binding(1) var<storage, read_write> answers: array<vec4<f32>>;
        @compute @workgroup_size({GROUP})
        fn ask(@builtin(global_invocation_id) id: vec3<u32>) {{
            if id.x < arrayLength(&questions) {{
                let question = questions[id.x];
                answers[2u * id.x] = vec4<f32>(in_scattered(question.point, question.direction), 0.0);
                answers[2u * id.x + 1u] = fog(question.point, question.direction, question.depth, {STEPS}u);
            }}
        }}"
    );
    let module =
        device.create_shader_module(ShaderModuleDescriptor { label: None, source: ShaderSource::Wgsl(source.into()) });
    let pipeline = device.create_compute_pipeline(&ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("ask"),
        compilation_options: Default::default(),
        cache: None,
    });

    let grid = &levels.levels()[0];
    let bounds = grid.lattice().bounds();
    let count = grid.basis().count();
    let probes = Probes {
        corner: bounds.min.into(),
        scale: 1.0,
        size: bounds.size().into(),
        numbers: count as u32,
        counts: grid.lattice().size(),
        levels: levels.levels().len() as u32 - 1,
    };
    let buffer =
        |contents: &[u8], usage| device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage });
    let uniform = buffer(bytemuck::bytes_of(&probes), BufferUsages::UNIFORM);
    let texture = |(size, texels): ([u32; 3], Vec<f16>)| {
        let [width, height, depth_or_array_layers] = size;
        let descriptor = TextureDescriptor {
            label: None,
            size: Extent3d { width, height, depth_or_array_layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D3,
            format: TextureFormat::Rgba16Float,
            usage: TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        };
        let bytes: Vec<u8> = texels.iter().flat_map(|number| number.to_le_bytes()).collect();
        device
            .create_texture_with_data(&queue, &descriptor, TextureDataOrder::LayerMajor, &bytes)
            .create_view(&Default::default())
    };
    let valid = |probe: &Probe| if probe.state() == ProbeState::Valid { 1.0 } else { 0.0 };
    let mut views: Vec<_> = (0..NUMBERS)
        .map(|number| {
            // What lies beyond the numbers of a probe is bound, but must not be read.
            texture(atlas(levels, |grid, index| {
                let held = grid.held(index).get(number).map_or([f32::NAN; 3], |held| [held[0], held[1], held[2]]);
                (held, valid(&grid.probes()[index]))
            }))
        })
        .collect();
    views.push(texture(atlas(levels, |grid, index| {
        let probe = &grid.probes()[index];
        (probe.albedo.0, probe.extinction.mean())
    })));
    for number in 0..2 {
        views.push(texture(atlas(levels, |grid, index| {
            let probe = &grid.probes()[index];
            let inner = if number == 0 && probe.is_inner() { 1.0 } else { 0.0 };
            (probe.planes()[number].to_array(), inner)
        })));
    }
    views.push(texture(index(levels)));

    let asked = buffer(bytemuck::cast_slice(questions), BufferUsages::STORAGE);
    let size = (questions.len() * 2 * size_of::<[f32; 4]>()) as u64;
    let empty = |usage| device.create_buffer(&BufferDescriptor { label: None, size, usage, mapped_at_creation: false });
    let told = empty(BufferUsages::STORAGE | BufferUsages::COPY_SRC);
    let read = empty(BufferUsages::MAP_READ | BufferUsages::COPY_DST);
    let bind = |group: u32, resources: Vec<BindingResource<'_>>| {
        let entries: Vec<_> =
            resources.into_iter().zip(0..).map(|(resource, binding)| BindGroupEntry { binding, resource }).collect();
        let layout = pipeline.get_bind_group_layout(group);
        device.create_bind_group(&BindGroupDescriptor { label: None, layout: &layout, entries: &entries })
    };
    let textures = views.iter().map(BindingResource::TextureView);
    let groups = [
        bind(0, std::iter::once(uniform.as_entire_binding()).chain(textures).collect()),
        bind(1, vec![asked.as_entire_binding(), told.as_entire_binding()]),
    ];
    let mut encoder = device.create_command_encoder(&Default::default());
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&pipeline);
    for (number, group) in (0..).zip(&groups) {
        pass.set_bind_group(number, group, &[]);
    }
    pass.dispatch_workgroups((questions.len() as u32).div_ceil(GROUP), 1, 1);
    drop(pass);
    encoder.copy_buffer_to_buffer(&told, 0, &read, 0, size);
    queue.submit([encoder.finish()]);
    read.slice(..).map_async(MapMode::Read, |result| result.expect("the answers can be read"));
    device.poll(PollType::wait_indefinitely())?;
    let mapped = read.slice(..).get_mapped_range()?;
    Ok(bytemuck::cast_slice(&mapped).to_vec())
}
