//! What a number must be to go to files and come back.

/// A number as VTK files store it.
pub trait Element: bytemuck::Pod + std::str::FromStr {
    /// The name of the type in VTK's XML files, e.g. `Float64`.
    const NAME: &'static str;

    /// The same number as f64, if f64 has it.
    fn exact(self) -> Option<f64>;
}
