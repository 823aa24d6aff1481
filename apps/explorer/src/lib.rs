//! Where to go next: one module per strategy behind one trait.
