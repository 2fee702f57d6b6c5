//! Control code.
#![cfg_attr(not(test), no_std)]
