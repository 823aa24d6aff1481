//! The app framework (signatures; the body is being written).

/// What an app may fail with.
pub type AppError = Box<dyn std::error::Error + Send + Sync>;

/// An app.
pub trait App: Send {
    /// Register here. Called once the broker has accepted the app.
    fn on_start_up(&mut self, comms: &mut Comms) -> Result<(), AppError>;
    /// One message.
    fn on_new_mail(&mut self, comms: &mut Comms, mail: &Mail<'_>) -> Result<(), AppError>;
    /// Called at the app tick, if there is one.
    fn iterate(&mut self, _comms: &mut Comms) -> Result<(), AppError> {
        Ok(())
    }
    /// Called on the way out, while the bus is still there.
    fn on_stop(&mut self, _comms: &mut Comms) -> Result<(), AppError> {
        Ok(())
    }
}
/// The app's end of the bus.
pub struct Comms {}
/// A message.
pub struct Mail<'a>(&'a ());
