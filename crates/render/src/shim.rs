#![allow(missing_docs, unreachable_pub, reason="temporary")]
use crate::*;
#[derive(Clone, Copy, Debug, PartialEq, Eq)] pub enum Method { None, Ndf, Amr, NdfSn, AmrSn }
#[derive(Clone, Copy, Debug)] pub enum IntegratorKind { Volpath, Raymarch { samples_per_segment: u32 } }
#[derive(Clone, Debug)] pub struct RenderOptions { pub method: Method, pub voxel_size: Option<f64>, pub integrator: IntegratorKind, pub spp: Option<u32>, pub seed: Option<u64>, pub threads: Option<usize>, pub crop: Option<scene::PixelRect>, pub max_voxels: u64 }
impl RenderOptions { pub fn validate(&self, _:&scene::Scene)->Result<(),RenderError>{Ok(())} }
#[derive(Clone, Debug)] pub struct Image { pub width: u32, pub height: u32, pub pixels: Vec<Rgb> }
#[derive(Debug)] pub struct Rendering { pub image: Image, pub statistics: Statistics }
pub trait Progress: Sync { fn phase(&self, name: &str); fn pixels_total(&self, n: u64); fn pixels_done(&self, n: u64); fn cancelled(&self) -> bool; }
#[derive(Debug)] pub struct Statistics { pub build: acceleration::BuildReport, pub c: Counters, pub refused: u64, pub proved: u64, pub s:[f64;2] }
impl Statistics { pub fn new(_:&scene::Scene,_:&RenderOptions,b:&acceleration::BuildReport,c:&Counters,x:f64,y:f64)->Self{Self{build:b.clone(),c:*c,refused:c.refused,proved:c.proved,s:[x,y]}} }
impl std::fmt::Display for Method { fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result { write!(f,"{self:?}") } }
