//! What a variable carries, asked of the broker, and Python's values as values of that.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use elk_bus::broker::table::{CommunityTable, REQUEST, TABLE};
use elk_bus::clock::Stopwatch;
use elk_bus::codec::MAX_VALUE_BYTES;
use elk_bus::moos::session::BYTES_TYPE;
use elk_bus::{Client, Community, Type, Value};
use elk_pipe::carried::Carried;
use elk_pipe::words::{Publish, check_variable};
use pyo3::prelude::*;
use pyo3::types::{PyByteArray, PyBytes, PyFloat, PyInt, PyMemoryView, PyString};

use crate::encode::{encode, has_arrays};
use crate::error::{error, within};
use crate::json::to_json;
use crate::text::{Number, Text};

/// How long the broker may take to answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// Variables of which it is kept what they carry.
const MOST_KNOWN: usize = 4096;

/// What the variables carry that were asked for.
pub struct Known {
    community: Community,
    /// The name of who asks.
    asker: String,
    carried: Mutex<BTreeMap<String, Carried>>,
    /// Held while somebody asks: two of one name are not let in.
    asking: Mutex<()>,
}

impl Known {
    pub fn new(name: &str, community: &Community) -> Self {
        Self {
            community: community.clone(),
            asker: format!("{name}_asks"),
            carried: Mutex::default(),
            asking: Mutex::default(),
        }
    }

    /// What Python means by a value of a variable: numbers and texts as they are unless a type is named, bytes as MOOS'
    /// own, all else as a value of the type that the variable carries.
    ///
    /// # Errors
    /// It is no such value, or nobody knows what the variable carries.
    pub fn value(&self, variable: &str, value: &Bound<'_, PyAny>, type_name: Option<String>) -> PyResult<Value> {
        check_variable(variable).map_err(error)?;
        let value = self.value_of(variable, value, type_name).map_err(|wrong| within(value.py(), variable, wrong))?;
        match value.as_ref().byte_len() {
            0..=MAX_VALUE_BYTES => Ok(value),
            length => Err(error(format_args!("{variable}: {}", too_long(length)))),
        }
    }

    fn value_of(&self, variable: &str, value: &Bound<'_, PyAny>, type_name: Option<String>) -> PyResult<Value> {
        if type_name.is_none()
            && let Some(value) = plain(value)?
        {
            return Ok(value);
        }
        let has_arrays = has_arrays(value)?;
        let json = if has_arrays { serde_json::Value::Null } else { to_json(value)? };
        let said = Publish { variable: variable.to_owned(), value: json, type_name };
        let carried = value.py().detach(|| self.carried(&said)).map_err(error)?;
        match &carried {
            Carried::Typed(type_) if has_arrays => {
                carried.check_type(&said).map_err(error)?;
                let description = type_.as_ref().description();
                let undescribed = || error(format_args!("nobody has described {}", type_.as_ref().name()));
                let bytes = encode(&*description.ok_or_else(undescribed)?, value)?;
                Ok(Value::Binary { type_: type_.clone(), bytes })
            }
            _ => carried.value(&said).map_err(error),
        }
    }

    /// What a variable carries, as the broker says, or as the value says of which nobody has said it.
    fn carried(&self, said: &Publish) -> Result<Carried, String> {
        let known = self.carried.lock().unwrap_or_else(PoisonError::into_inner).get(&said.variable).cloned();
        if let Some(carried) = known {
            return Ok(carried);
        }
        let table = self.ask()?;
        let carried = Carried::of(&table, &said.variable).map_or_else(|| Carried::guessed(&table, said), Ok)?;
        let mut all = self.carried.lock().unwrap_or_else(PoisonError::into_inner);
        if all.len() >= MOST_KNOWN {
            all.clear();
        }
        all.insert(said.variable.clone(), carried.clone());
        Ok(carried)
    }

    /// What a variable carries, as JSON: the type's name, an example and its description; `None`: nobody has said.
    ///
    /// # Errors
    /// The broker does not answer.
    pub fn describe(&self, variable: &str) -> Result<Option<String>, String> {
        let carried = Carried::of(&self.ask()?, variable);
        Ok(carried.map(|carried| carried.as_json().to_string()))
    }

    /// Asks anew what a variable carries, the next time.
    pub fn forget(&self, variable: &str) {
        self.carried.lock().unwrap_or_else(PoisonError::into_inner).remove(variable);
    }

    /// Asks the broker, as a client that comes and goes: whoever is in the midst of a callback hears nothing meanwhile.
    fn ask(&self) -> Result<CommunityTable, String> {
        let _turn = self.asking.lock().unwrap_or_else(PoisonError::into_inner);
        let words = |error: &dyn std::fmt::Display| error.to_string();
        let mut client = Client::connect(&self.community, &self.asker).map_err(|error| words(&error))?;
        client.comms.notify(REQUEST, 1.0).map_err(|error| words(&error))?;
        let waited = Stopwatch::start();
        let mut answer = None;
        while answer.is_none() && waited.elapsed() < PATIENCE {
            let receive = client.receive(Duration::from_millis(200), |mail| {
                if mail.is(&TABLE) {
                    answer = Some(mail.decode(&TABLE));
                }
            });
            receive.map_err(|error| words(&error))?;
        }
        let silent = || format!("the broker of {} does not say what variables carry; is it stopped?", self.community);
        answer.ok_or_else(silent)?.map_err(|error| words(&error))
    }
}

fn too_long(length: usize) -> String {
    format!("a value of {length} bytes; at most {MAX_VALUE_BYTES} are allowed: publish it in parts")
}

/// Numbers, texts and bytes as they are; `None`: it is none of them.
fn plain(value: &Bound<'_, PyAny>) -> PyResult<Option<Value>> {
    if value.is_instance_of::<PyFloat>() || value.is_instance_of::<PyInt>() {
        let Number(number) = value.extract()?;
        return Ok(Some(Value::Double(number)));
    }
    if value.is_instance_of::<PyString>() {
        short(value.len()?)?;
        let Text(text) = value.extract()?;
        return Ok(Some(Value::Text(text)));
    }
    let bytes = bytes_of(value)?;
    Ok(bytes.map(|bytes| Value::Binary { type_: Type::undescribed(BYTES_TYPE, 0), bytes }))
}

/// Sees that so many bytes are not too many, before they are copied.
fn short(length: usize) -> PyResult<()> {
    if length > MAX_VALUE_BYTES { Err(error(too_long(length))) } else { Ok(()) }
}

/// The bytes of bytes-like values.
fn bytes_of(value: &Bound<'_, PyAny>) -> PyResult<Option<Vec<u8>>> {
    if let Ok(bytes) = value.cast::<PyBytes>() {
        short(bytes.as_bytes().len())?;
        return Ok(Some(bytes.as_bytes().to_vec()));
    }
    let length = if value.is_instance_of::<PyByteArray>() {
        value.len()?
    } else if value.is_instance_of::<PyMemoryView>() {
        value.getattr("nbytes")?.extract()?
    } else {
        return Ok(None);
    };
    short(length)?;
    bytes_of(&value.py().get_type::<PyBytes>().call1((value,))?)
}
