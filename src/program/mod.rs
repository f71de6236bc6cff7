//! From the program file to the ring: interpretation and planning, outside real time.
