//! The simulated machine: controlled nodes with drives and motors behind them.
