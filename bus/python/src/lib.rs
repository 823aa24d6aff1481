//! elk for Python: what lies in the wheel beside the Python of `python/elk/`, which offers it to people.
//!
//! | module | one idea |
//! |---|---|
//! | `app` | an app whose callbacks are Python's, run by the framework that runs every app |
//! | `outgoing` | what Python says on the bus, from whichever thread |
//! | `carried` | what a variable carries, asked of the broker, and Python's values as values of that |
//! | `message` | a message as Python has it |
//! | `bytes` | a value's bytes, in shared memory for as long as Python holds them |
//! | `decode` | bytes as Python's values, by the description that travels with their type |
//! | `encode` | dicts with numpy arrays as bytes |
//! | `json` | Python's values as JSON, from which descriptions make bytes |
//! | `log` | recorded runs |
//! | `clock` | the time of the community that the process has joined |
//! | `text` | Python's texts and numbers as the bus has them |
//! | `fork` | which process something was made in |
//! | `error` | what Python is told when something cannot be done |

mod app;
mod bytes;
mod carried;
mod clock;
mod decode;
mod encode;
mod error;
mod fork;
mod json;
mod log;
mod message;
mod outgoing;
mod text;

use pyo3::prelude::*;

#[pymodule]
fn _elk(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("Error", module.py().get_type::<error::Error>())?;
    module.add("Rejection", module.py().get_type::<error::Rejection>())?;
    module.add("DecodeError", error::decode_error_type(module.py())?)?;
    module.add_class::<app::Runner>()?;
    module.add_class::<message::Message>()?;
    module.add_class::<bytes::View>()?;
    module.add_class::<log::LogReader>()?;
    module.add_function(wrap_pyfunction!(clock::time, module)?)?;
    module.add_function(wrap_pyfunction!(clock::local_time, module)?)?;
    module.add_function(wrap_pyfunction!(clock::get_moos_timewarp, module)?)?;
    module.add_function(wrap_pyfunction!(clock::set_moos_timewarp, module)?)?;
    module.add_function(wrap_pyfunction!(app::interrupt, module)?)?;
    module.add_function(wrap_pyfunction!(app::let_go_of_parent, module)?)?;
    module.add_function(wrap_pyfunction!(app::launched, module)?)
}
