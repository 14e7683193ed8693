use tilewright::pass::Executor;
use tilewright::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let gpu = vk::Gpu::open(&vk::GpuOptions::default()).unwrap();
    let t = std::time::Instant::now();
    let s = scene::Scene::load(a[1].as_ref(), &Default::default()).unwrap();
    eprintln!("load {:?}", t.elapsed());
    let extent = image::Extent::new(a[3].parse().unwrap(), a[4].parse().unwrap());
    let cam = s.default_camera(extent);
    let t = std::time::Instant::now();
    let pass = s.pass(extent, &cam, &Default::default()).unwrap();
    eprintln!("pass {:?} draws {}", t.elapsed(), pass.draws.len());
    let mut r = compute::Renderer::new(&gpu).unwrap();
    r.time_stages(true);
    let t = std::time::Instant::now();
    let mut p = r.prepare(&pass).unwrap();
    eprintln!("prepare {:?}", t.elapsed());
    for _ in 0..3 {
        let t = std::time::Instant::now();
        let tm = p.execute().unwrap();
        eprintln!("execute {:?}", t.elapsed());
        let mut m: Vec<(String, u64)> = vec![];
        for (l, n) in tm.stages {
            if let Some(x) = m.iter_mut().find(|x| x.0 == l) { x.1 += n } else { m.push((l, n)) }
        }
        for (l, n) in m {
            eprint!("  {l} {:.2}ms", n as f64 / 1e6);
        }
        eprintln!();
    }
    let f = p.read().unwrap();
    ::image::save_buffer(
        &a[2],
        &f.color.bytes,
        extent.width,
        extent.height,
        ::image::ColorType::Rgba8,
    )
    .unwrap();
}
