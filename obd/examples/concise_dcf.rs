//! A concise DCF (0x1F22) is written and carried out on a dictionary, as a managing node and its device do: `cargo run -p
//! isocnc-obd --example concise_dcf`.

use std::error::Error;

use obd::cdc::{CdcReader, CdcWriter};
use obd::{DataType, Dictionary, EntryDef, lines_of, octets_of};

const DEVICE: &[EntryDef] = &[
    EntryDef::rw(0x6065, DataType::U32, "following error window").default(1000),
    EntryDef::rw(0x6060, DataType::I8, "mode of operation").limits(0, 10),
    EntryDef::ro(0x6064, DataType::I32, "position").tpdo(),
];

fn main() -> Result<(), Box<dyn Error>> {
    let mut octets = [0; 64];
    let mut writer = CdcWriter::new(&mut octets)?;
    writer.push(0x6065, 0, &5000_u32.to_le_bytes())?;
    writer.push(0x6060, 0, &[8])?;
    writer.push(0x6064, 0, &0_u32.to_le_bytes())?;
    let configuration = writer.finish();

    let mut dictionary = Dictionary::<{ lines_of(DEVICE) }, { octets_of(DEVICE) }>::new(&[DEVICE])?;
    let mut refused = 0;
    for write in CdcReader::new(configuration)? {
        let write = write?;
        match dictionary.write(write.index, write.sub, write.value) {
            Ok(_) => println!("0x{:04X}/{} written", write.index, write.sub),
            Err(code) => {
                refused += 1;
                println!("0x{:04X}/{} refused: {code}", write.index, write.sub);
            }
        }
    }
    assert_eq!((dictionary.read(0x6065, 0)?, refused), (&5000_u32.to_le_bytes()[..], 1));
    Ok(())
}
