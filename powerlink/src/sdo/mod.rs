//! Service data objects: access to the object dictionary of another node through ASnd frames.
