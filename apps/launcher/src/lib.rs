//! Starts a mission's broker and apps as processes, watches over them, sums up.
