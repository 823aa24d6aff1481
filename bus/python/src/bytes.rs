//! A value's bytes, in its publisher's shared memory for as long as Python holds them.
//!
//! What is held counts its holders without regard to threads, and Python lets go of objects on any of them. So it is let go
//! of by nobody but the thread that the client lives on: others put it on a shelf, which that thread clears.

use std::mem::ManuallyDrop;
use std::ops::Deref;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elk_bus::link::Held;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::fork::Home;

/// The bytes of a value.
pub enum Bytes {
    /// A copy: of a value that came in a batch.
    Own(Vec<u8>),
    /// Where its publisher wrote it.
    InPlace(Shelved),
}

impl Deref for Bytes {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        match self {
            Bytes::Own(bytes) => bytes,
            Bytes::InPlace(held) => &held.value.0,
        }
    }
}

/// What other threads may look at, and may not let go of.
struct Apart(Held);

// SAFETY: a `Held` counts its holders without atomics, which is why it stays on one thread; its bytes are written by nobody
// while it is held. Here other threads do no more than read the bytes and move it: it is cloned and dropped by the client's
// thread alone, or, once nothing of the client is left, under the lock of its `Shelf`.
unsafe impl Send for Apart {}
// SAFETY: as above.
unsafe impl Sync for Apart {}

/// A value that is held, and goes to the shelf when it is let go of.
pub struct Shelved {
    value: ManuallyDrop<Apart>,
    shelf: Arc<Shelf>,
}

impl Shelved {
    /// A value of the client whose shelf this is.
    pub fn new(value: Held, shelf: &Arc<Shelf>) -> Self {
        Self { value: ManuallyDrop::new(Apart(value)), shelf: shelf.clone() }
    }
}

impl Drop for Shelved {
    fn drop(&mut self) {
        if self.shelf.home.is_elsewhere() {
            return; // the client that it was made for still reads it
        }
        // SAFETY: it is taken once, here, and never looked at again.
        let value = unsafe { ManuallyDrop::take(&mut self.value) };
        self.shelf.put(value);
    }
}

/// Where values lie that Python has let go of, until the client's thread comes by.
pub struct Shelf {
    home: Home,
    state: Mutex<OnShelf>,
    /// Has the client's thread come.
    ring: Box<dyn Fn() + Send + Sync>,
}

#[derive(Default)]
struct OnShelf {
    values: Vec<Apart>,
    /// There is no client any more.
    is_closed: bool,
}

impl Shelf {
    /// An empty one; `ring` has the client's thread clear it soon.
    pub fn new(ring: impl Fn() + Send + Sync + 'static) -> Self {
        Self { home: Home::here(), state: Mutex::default(), ring: Box::new(ring) }
    }

    fn lock(&self) -> MutexGuard<'_, OnShelf> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put(&self, value: Apart) {
        let mut state = self.lock();
        if state.is_closed {
            // Under the lock: those that are left share a count.
            drop(value);
            return;
        }
        state.values.push(value);
        if state.values.len() == 1 {
            (self.ring)();
        }
    }

    /// Lets go of what lies here: on the client's thread.
    pub fn clear(&self) {
        self.lock().values.clear();
    }

    /// The client is gone, and nothing of it is left but what Python holds.
    pub fn close(&self) {
        let mut state = self.lock();
        state.is_closed = true;
        state.values.clear();
    }
}

impl Drop for Shelf {
    fn drop(&mut self) {
        if self.home.is_elsewhere() {
            let state = self.state.get_mut().unwrap_or_else(PoisonError::into_inner);
            std::mem::forget(std::mem::take(&mut state.values));
        }
    }
}

/// An array over a value's bytes, for numpy: `numpy.asarray(view)` copies nothing, and keeps the bytes.
#[pyclass(frozen, module = "elk")]
pub struct View {
    pub bytes: Arc<Bytes>,
    pub offset: usize,
    pub shape: Vec<usize>,
    pub element: Element,
}

/// What numpy calls the elements.
pub enum Element {
    /// Numbers, as `<f4`.
    Number(String),
    /// Records: each field's name, numbers and shape.
    Record(Vec<(String, String, Vec<usize>)>),
}

impl View {
    /// All of the bytes.
    pub fn whole(bytes: &Arc<Bytes>) -> Self {
        Self { bytes: bytes.clone(), offset: 0, shape: vec![bytes.len()], element: Element::Number("|u1".to_owned()) }
    }

    /// The numpy array.
    pub fn into_array(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        let dtype = match &self.element {
            Element::Number(_) => None,
            // The array interface has no records without a description, which numpy reads as a dtype.
            Element::Record(fields) => Some(record(py, fields)?),
        };
        let shape = PyTuple::new(py, &self.shape)?;
        let flat = py.import("numpy")?.call_method1("asarray", (Bound::new(py, self)?,))?;
        match dtype {
            None => Ok(flat),
            Some(dtype) => flat.call_method1("view", (dtype,))?.call_method1("reshape", (shape,)),
        }
    }
}

fn record<'py>(py: Python<'py>, fields: &[(String, String, Vec<usize>)]) -> PyResult<Bound<'py, PyAny>> {
    let fields = fields.iter().map(|(name, number, shape)| Ok((name, number, PyTuple::new(py, shape)?)));
    py.import("numpy")?.call_method1("dtype", (fields.collect::<PyResult<Vec<_>>>()?,))
}

/// So many in each of a shape's places; `None`: more than there can be.
pub fn product(each: usize, shape: &[usize]) -> Option<usize> {
    shape.iter().try_fold(each, |product, side| product.checked_mul(*side))
}

/// Bytes of a number, as numpy names it.
pub fn width(number: &str) -> usize {
    number.get(2..).and_then(|width| width.parse().ok()).unwrap_or(1)
}

impl Element {
    /// Bytes of one; `None`: more than there can be.
    pub fn width(&self) -> Option<usize> {
        match self {
            Element::Number(number) => Some(width(number)),
            Element::Record(fields) => {
                let mut widths = fields.iter().map(|(_, number, shape)| product(width(number), shape));
                widths.try_fold(0_usize, |sum, width| sum.checked_add(width?))
            }
        }
    }
}

#[pymethods]
impl View {
    /// numpy's array interface, version 3: read only.
    #[getter]
    fn __array_interface__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (number, shape) = match &self.element {
            Element::Number(number) => (number.as_str(), PyTuple::new(py, &self.shape)?),
            Element::Record(_) => {
                // `None` is no array that was ever read.
                let bytes = self.element.width().and_then(|width| product(width, &self.shape)).unwrap_or_default();
                ("|u1", PyTuple::new(py, [bytes])?)
            }
        };
        let interface = PyDict::new(py);
        let start = self.bytes.get(self.offset..).unwrap_or_default().as_ptr() as usize;
        interface.set_item("version", 3)?;
        interface.set_item("typestr", number)?;
        interface.set_item("shape", shape)?;
        interface.set_item("data", (start, true))?;
        Ok(interface)
    }
}
