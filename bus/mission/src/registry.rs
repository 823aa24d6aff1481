//! All app types that a program offers, looked up by element and type.

use crate::spec::AppType;

/// The app types that mission files can name.
#[derive(Debug, Clone, Default)]
pub struct Registry {
    types: Vec<&'static AppType>,
}

impl Registry {
    /// The types of all `tables`, in their order.
    pub fn new(tables: &[&'static [AppType]]) -> Self {
        let types = tables.iter().flat_map(|table| table.iter()).collect();
        Self { types }
    }

    /// All types, in their order.
    pub fn types(&self) -> impl Iterator<Item = &'static AppType> {
        self.types.iter().copied()
    }

    /// The types of an element.
    pub fn of_element(&self, element: &str) -> impl Iterator<Item = &'static AppType> {
        self.types().filter(move |app_type| app_type.element == element)
    }

    /// One type.
    pub fn find(&self, element: &str, name: &str) -> Option<&'static AppType> {
        self.of_element(element).find(|app_type| app_type.name == name)
    }
}

impl FromIterator<&'static AppType> for Registry {
    fn from_iter<I: IntoIterator<Item = &'static AppType>>(types: I) -> Self {
        Self { types: types.into_iter().collect() }
    }
}
