//! A recorded run: what crossed the bus, as MCAP, written and read.
