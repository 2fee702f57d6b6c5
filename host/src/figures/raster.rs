//! A finished figure, as SVG and as PNG.

use crate::run::{RunError, write_atomic};
use resvg::{tiny_skia, usvg};
use std::path::Path;
use std::sync::{Arc, OnceLock};

/// PNG pixels per SVG unit: sharp on high-density screens and in print.
const SCALE: f32 = 2.0;

/// A finished figure.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Figure {
    /// The SVG document.
    pub svg: String,
}

/// A figure that cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The rasteriser refused.
    #[error("cannot draw the PNG of {name} ({why}): use its SVG, and report this")]
    Raster {
        /// The figure.
        name: String,
        /// What the rasteriser says.
        why: String,
    },
    /// The files cannot be written.
    #[error(transparent)]
    Write(#[from] RunError),
}

impl Figure {
    /// The PNG, at two pixels per SVG unit. `name` is for the message if that fails.
    pub fn png(&self, name: &str) -> Result<Vec<u8>, FigureError> {
        let failed = |why: String| FigureError::Raster { name: name.into(), why };
        let options = usvg::Options { font_family: "Noto Sans".into(), fontdb: fonts(), ..usvg::Options::default() };
        let tree = usvg::Tree::from_str(&self.svg, &options).map_err(|error| failed(error.to_string()))?;
        let size = tree.size().to_int_size();
        let (width, height) = (size.width() * SCALE as u32, size.height() * SCALE as u32);
        let mut pixels = tiny_skia::Pixmap::new(width, height).ok_or_else(|| failed("it is empty".into()))?;
        resvg::render(&tree, tiny_skia::Transform::from_scale(SCALE, SCALE), &mut pixels.as_mut());
        pixels.encode_png().map_err(|error| failed(error.to_string()))
    }

    /// Writes `name.svg` and `name.png` into `folder`.
    pub fn save(&self, folder: &Path, name: &str) -> Result<(), FigureError> {
        write_atomic(&folder.join(format!("{name}.svg")), self.svg.as_bytes())?;
        write_atomic(&folder.join(format!("{name}.png")), &self.png(name)?)?;
        Ok(())
    }
}

/// Our font and no other: a figure must not depend on what is installed.
fn fonts() -> Arc<usvg::fontdb::Database> {
    static FONTS: OnceLock<Arc<usvg::fontdb::Database>> = OnceLock::new();
    Arc::clone(FONTS.get_or_init(|| {
        let mut fonts = usvg::fontdb::Database::new();
        fonts.load_font_data(ttf_noto_sans::REGULAR.to_vec());
        fonts.load_font_data(ttf_noto_sans::BOLD.to_vec());
        Arc::new(fonts)
    }))
}
