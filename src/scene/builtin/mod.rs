//! Scenes that need no file.

mod shapes;
mod soup;
mod still_life;
mod teapot;

use super::{
    Scene,
    build::{Builder, Fault},
    camera::Camera,
    material::{AlphaMode, Map, Material, TextureUse},
    mesh::Mesh,
    texture::{ColorSpace, with_mips},
};
use crate::{Error, Result, image::Extent, texture::Texture};
use glam::{DVec3, Mat4, Vec3};

type Make = fn(&mut Builder, u64) -> std::result::Result<(), String>;

/// Every scene, the default first.
const SCENES: [(&str, Make); 10] = [
    ("still-life", still_life::build),
    ("teapot", plain_teapot),
    ("triangle", triangle),
    ("cube", cube),
    ("spheres", spheres),
    ("checker", checker),
    ("torus-knot", torus_knot),
    ("alpha", alpha),
    ("soup", inner_soup),
    ("soup-clipped", clipped_soup),
];

impl Scene {
    /// Checks that [`Scene::builtin`] takes `name`, without making the scene.
    ///
    /// # Errors
    /// As there.
    pub fn check_builtin(name: &str) -> Result<()> {
        find(name).map(|_| ())
    }

    /// The names that [`Scene::builtin`] takes.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        SCENES.iter().map(|(name, _)| *name)
    }

    /// The built-in scene `name`. A number after a colon (`soup:7`) seeds the random ones.
    ///
    /// # Errors
    /// [`Error::Usage`] that lists the names, if there is no such scene.
    pub fn builtin(name: &str) -> Result<Scene> {
        let (base, make, seed) = find(name)?;
        let mut builder = Builder::default();
        let made = make(&mut builder, seed).map_err(Fault::Input);
        let scene = made.and_then(|()| builder.finish(base));
        scene.map_err(|fault| fault.into_error(name.as_ref()))
    }
}

/// The scene called `name`, with its seed.
fn find(name: &str) -> Result<(&'static str, Make, u64)> {
    let (base, seed) = name.split_once(':').unwrap_or((name, "1"));
    let Some(&(base, make)) = SCENES.iter().find(|(known, _)| *known == base) else {
        let names: Vec<_> = Scene::builtin_names().collect();
        return Err(Error::Usage(format!(
            "there is no built-in scene `{name}`; there are {}",
            names.join(", ")
        )));
    };
    let seed = seed.parse().map_err(|_| {
        Error::Usage(format!("`{seed}` in `builtin:{name}` is no seed: a number is expected"))
    })?;
    Ok((base, make, seed))
}

/// A dielectric.
fn plastic(color: [f32; 3], roughness: f32) -> Material {
    Material {
        base_color: Vec3::from_array(color).extend(1.0),
        metallic: 0.0,
        roughness,
        ..Material::default()
    }
}

/// Vertex colours as they are, from both sides.
fn painted() -> Material {
    Material { unlit: true, double_sided: true, ..Material::default() }
}

fn add(
    builder: &mut Builder,
    mesh: &Mesh,
    material: Material,
    at: Mat4,
) -> std::result::Result<(), String> {
    builder.materials.push(material);
    builder.mesh_node(mesh, builder.materials.len() - 1, at.as_dmat4())
}

/// A texture of `squares` x `squares` of two colours (sRGB).
fn checkerboard(squares: u32, size: u32, colors: [[u8; 3]; 2]) -> Texture {
    let extent = Extent::new(squares * size, squares * size);
    let texel = |i: u32| {
        let (x, y) = (i % extent.width / size, i / extent.width / size);
        let [r, g, b] = colors[(x + y) as usize % 2];
        [r, g, b, 255]
    };
    let texels = (0..extent.pixels() as u32).flat_map(texel).collect();
    with_mips("checkerboard", extent, texels, ColorSpace::Srgb)
}

fn plain_teapot(builder: &mut Builder, _: u64) -> std::result::Result<(), String> {
    // Between lid and rim, and from above, its inside is seen.
    let material = Material { double_sided: true, ..plastic([0.62, 0.14, 0.08], 0.3) };
    add(builder, &teapot::teapot(16), material, Mat4::IDENTITY)
}

fn triangle(builder: &mut Builder, _: u64) -> std::result::Result<(), String> {
    let (x, y) = (3f32.sqrt() / 2.0, 0.5);
    let mesh = Mesh {
        positions: vec![Vec3::new(-x, -y, 0.0), Vec3::new(x, -y, 0.0), Vec3::Y],
        colors: [Vec3::X, Vec3::Y, Vec3::Z].map(|c| c.extend(1.0)).to_vec(),
        ..Mesh::default()
    };
    builder.cameras.push(Camera::look_at(DVec3::Z * 3.0, DVec3::ZERO, DVec3::Y, 0.8));
    add(builder, &mesh, painted(), Mat4::IDENTITY)
}

fn cube(builder: &mut Builder, _: u64) -> std::result::Result<(), String> {
    let texture = builder.texture(|| Ok(checkerboard(4, 16, [[235, 225, 205], [60, 110, 150]])));
    let mut material = plastic([1.0; 3], 0.5);
    material.maps[Map::BaseColor as usize] = Some(TextureUse::new(texture));
    add(builder, &shapes::cube(), material, Mat4::IDENTITY)
}

/// Metallic along one direction, roughness along the other.
fn spheres(builder: &mut Builder, _: u64) -> std::result::Result<(), String> {
    let mesh = shapes::sphere(48, 24);
    builder.materials.clear();
    for row in 0..5 {
        for column in 0..7 {
            let mut material = plastic([0.86, 0.57, 0.25], (column as f32 / 6.0).max(0.05));
            material.metallic = row as f32 / 4.0;
            let at = Vec3::new(column as f32 - 3.0, row as f32 - 2.0, 0.0) * 2.3;
            add(builder, &mesh, material, Mat4::from_translation(at))?;
        }
    }
    Ok(())
}

/// A plane to the horizon: what mip levels and derivatives are for. It crosses the border.
fn checker(builder: &mut Builder, _: u64) -> std::result::Result<(), String> {
    let texture = builder.texture(|| Ok(checkerboard(8, 32, [[240, 236, 228], [40, 44, 52]])));
    let mut material = plastic([1.0; 3], 0.6);
    material.maps[Map::BaseColor as usize] = Some(TextureUse::new(texture));
    let (eye, target) = (DVec3::new(0.0, 1.2, 8.0), DVec3::new(0.0, 0.6, 0.0));
    builder.cameras.push(Camera::look_at(eye, target, DVec3::Y, 0.9));
    add(builder, &shapes::floor(60.0, 8, 30.0), material, Mat4::IDENTITY)
}

fn torus_knot(builder: &mut Builder, _: u64) -> std::result::Result<(), String> {
    let mut material = plastic([0.95, 0.64, 0.37], 0.25);
    material.metallic = 1.0;
    let mesh = shapes::torus_knot(2.0, 3.0, 0.27, 720, 40);
    let turned = Mat4::from_rotation_x(std::f32::consts::FRAC_PI_2);
    add(builder, &mesh, material, turned)
}

/// Sheets of coloured glass before a solid one: blending in order.
fn alpha(builder: &mut Builder, _: u64) -> std::result::Result<(), String> {
    let up = Mat4::from_rotation_x(std::f32::consts::FRAC_PI_2);
    let sheet = shapes::floor(1.0, 2, 1.0);
    let back =
        Mat4::from_translation(Vec3::new(0.0, 0.0, -1.6)) * Mat4::from_scale(Vec3::splat(1.5));
    add(builder, &sheet, plastic([0.9; 3], 0.8), back * up)?;
    for i in 0..7 {
        let turn = i as f32 / 7.0 * std::f32::consts::TAU;
        let (s, c) = turn.sin_cos();
        let hue = Vec3::new(c, (turn - 2.1).cos(), (turn + 2.1).cos()) * 0.45 + 0.5;
        let at = Vec3::new(c * 0.55, s * 0.55, i as f32 * 0.3 - 1.0);
        let mut material = plastic(hue.to_array(), 0.2);
        material.base_color.w = 0.45;
        material.alpha = AlphaMode::Blend;
        material.double_sided = true;
        let turned = Mat4::from_translation(at) * Mat4::from_rotation_z(turn) * up;
        add(builder, &sheet, material, turned)?;
    }
    let eye = DVec3::new(1.2, 0.9, 5.2);
    builder.cameras.push(Camera::look_at(eye, DVec3::ZERO, DVec3::Y, 0.75));
    Ok(())
}

fn inner_soup(builder: &mut Builder, seed: u64) -> std::result::Result<(), String> {
    add(builder, &soup::soup(seed, 4000), painted(), Mat4::IDENTITY)
}

/// The soup seen from inside: triangles cross all borders, the near plane and the plane of the eye.
fn clipped_soup(builder: &mut Builder, seed: u64) -> std::result::Result<(), String> {
    let mut camera = Camera::look_at(DVec3::new(0.1, 0.05, 0.8), DVec3::NEG_Z, DVec3::Y, 1.2);
    camera.projection = super::Projection::Perspective { yfov: 1.2, near: 0.05, far: Some(1.8) };
    builder.cameras.push(camera);
    add(builder, &soup::soup(seed, 4000), painted(), Mat4::from_scale(Vec3::splat(1.3)))
}
