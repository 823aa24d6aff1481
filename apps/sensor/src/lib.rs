//! Where depth comes from: a simulated depth camera over OBJ worlds.
