//! Places the code at address 0: a probe loads it anywhere, and it has no data to find.
fn main() {
    let root = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_default();
    println!("cargo::rerun-if-changed=layout.x");
    println!("cargo::rustc-link-arg=-T{root}/layout.x");
}
