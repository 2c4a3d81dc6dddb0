//! Results as files that people read.
//!
//! **Enters** finished results of the other rooms. **Leaves** files: tables, figures as SVG and PNG, shaded pictures.
//!
//! | step | file |
//! |---|---|
//! | an output folder that appears whole or not at all | `folder.rs` |
//! | a figure in SVG, and the same rasterised | `figure.rs` |
//! | shaded triangles in a picture | `render.rs` |
//! | colours that colour-blind readers tell apart | `palette.rs` |
//! | the enclosure's pictures and tables | `enclosure.rs`, `enclosure_section.rs`, `enclosure_drawing.rs` |
//! | a relaxed foam as polygons, and for ParaView and viewers | `foam_surface.rs`, `foam_export.rs` |
//! | the foam's picture, charts and tables; a partition's cells | `foam_picture.rs`, `foam_chart.rs`, `foam_files.rs` |
//! | where a bubble wants to be: table, charts, coloured surface; a cluster | `bubble.rs`, `bubble_cluster.rs` |
//! | two layers of cells: picture, table; defects of both and chance | `layers.rs`, `layers_defects.rs` |
//! | what is written for a photograph of comb; the overlay | `comb.rs`, `comb_overlay.rs` |
//! | comb on its wall, for ParaView | `comb_on_wall.rs` |
//! | the page: text, scenes, photographs | `page.rs`, `page_scene.rs`, `page_photo.rs`, `page/`, `vendor/` |
//! | a comparison's charts, tables and files | `compare_charts.rs`, `compare_map.rs`, `compare_files.rs` |

pub mod bubble;
pub mod bubble_cluster;
pub mod comb;
mod comb_on_wall;
mod comb_overlay;
pub mod compare_charts;
pub mod compare_files;
pub mod compare_map;
pub mod enclosure;
pub mod enclosure_drawing;
pub mod enclosure_section;
pub mod figure;
pub mod foam_chart;
pub mod foam_export;
pub mod foam_files;
pub mod foam_picture;
pub mod foam_surface;
pub mod folder;
pub mod layers;
pub mod layers_defects;
mod legend;
pub mod page;
mod page_photo;
mod page_scene;
pub mod palette;
pub mod render;

pub use comb_on_wall::write_comb_vtp;
pub use page_photo::page_photo;
pub use page_scene::{Layer, LayerCells, Scene};
