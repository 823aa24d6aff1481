//! What the bus is measured against: plain programs that do nothing but carry the same messages.

pub mod bare_iceoryx2;
pub mod unix_stream;
