//! Objects of a simulated device, in parts: communication, process data, each axis; and which of them are process data.

use crate::wire::coe::abort;
use obd::{AbortCode, Access, DataType, Dictionary, EntryDef, Handle, PdoAccess};
use std::boxed::Box;
use std::ops::RangeInclusive;
use std::vec::Vec;

/// Lines of a part: a drive with all the axes that CiA 402 has room for.
pub const ENTRIES: usize = 1408;
/// Octets of the values of a part.
pub const OCTETS: usize = 10 * 1024;
/// Most entries of a PDO, and most PDOs of an assignment.
pub const PDO_ENTRIES: u8 = 12;
const ASSIGNED: u8 = 8;
/// Assignment of the outputs; that of the inputs behind it.
pub(super) const RX_ASSIGN: u16 = 0x1C12;
pub(super) const TX_ASSIGN: u16 = 0x1C13;

/// Objects of communication that a device with a CoE mailbox has.
pub const COMMUNICATION: &[EntryDef] = &[
    EntryDef::constant(0x1000, DataType::U32, "Device type"),
    EntryDef::ro(0x1001, DataType::U8, "Error register").tpdo(),
    EntryDef::constant(0x1008, DataType::VisibleString, "Device name").capacity(64),
    EntryDef::constant(0x1009, DataType::VisibleString, "Hardware version").capacity(16),
    EntryDef::constant(0x100A, DataType::VisibleString, "Software version").capacity(16),
    EntryDef::constant(0x1018, DataType::U32, "Identity").subs(1, 4),
    EntryDef::constant(0x1C00, DataType::U8, "Sync manager type")
        .sub(1)
        .default(1),
    EntryDef::constant(0x1C00, DataType::U8, "Sync manager type")
        .sub(2)
        .default(2),
    EntryDef::constant(0x1C00, DataType::U8, "Sync manager type")
        .sub(3)
        .default(3),
    EntryDef::constant(0x1C00, DataType::U8, "Sync manager type")
        .sub(4)
        .default(4),
    EntryDef::rw(0x1C12, DataType::U8, "RxPDO assign").limits(0, ASSIGNED as i64),
    EntryDef::rw(0x1C12, DataType::U16, "RxPDO assign").subs(1, ASSIGNED),
    EntryDef::rw(0x1C13, DataType::U8, "TxPDO assign").limits(0, ASSIGNED as i64),
    EntryDef::rw(0x1C13, DataType::U16, "TxPDO assign").subs(1, ASSIGNED),
    EntryDef::rw(0x1C32, DataType::U16, "SM output parameter").sub(1),
    EntryDef::rw(0x1C32, DataType::U32, "SM output parameter").sub(2),
    EntryDef::rw(0x1C32, DataType::U32, "SM output parameter").sub(3),
    EntryDef::ro(0x1C32, DataType::U16, "SM output parameter")
        .sub(4)
        .default(0x0007),
    EntryDef::ro(0x1C32, DataType::U32, "SM output parameter")
        .sub(5)
        .default(62_500),
    EntryDef::ro(0x1C32, DataType::U32, "SM output parameter")
        .sub(6)
        .default(10_000),
    EntryDef::rw(0x1C33, DataType::U16, "SM input parameter").sub(1),
    EntryDef::rw(0x1C33, DataType::U32, "SM input parameter").sub(2),
    EntryDef::rw(0x1C33, DataType::U32, "SM input parameter").sub(3),
    EntryDef::ro(0x1C33, DataType::U16, "SM input parameter")
        .sub(4)
        .default(0x0007),
    EntryDef::ro(0x1C33, DataType::U32, "SM input parameter")
        .sub(5)
        .default(62_500),
    EntryDef::ro(0x1C33, DataType::U32, "SM input parameter")
        .sub(6)
        .default(10_000),
];

/// A part of the objects.
pub type Part = Dictionary<ENTRIES, OCTETS>;
/// Whether a part takes a value for one of its objects, by index there, sub-index and octets.
pub type WriteCheck = fn(&Part, u16, u8, &[u8]) -> Result<(), AbortCode>;

/// A part of the objects, which may lie elsewhere than its table says: those of axis n by n · 0x0800.
#[derive(Clone, Debug)]
struct Place {
    indices: RangeInclusive<u16>,
    shift: u16,
    part: Box<Part>,
}

/// Where a value lies.
#[derive(Clone, Copy, Debug)]
pub struct ObjectRef {
    place: usize,
    handle: Handle,
}

/// A value of the process data.
#[derive(Clone, Copy, Debug)]
struct Field {
    object: ObjectRef,
    bit: usize,
    bits: usize,
}

/// Process data of one direction.
#[derive(Clone, Debug, Default)]
pub struct ProcessData {
    fields: Vec<Field>,
    bits: usize,
}

impl ProcessData {
    /// Whole octets.
    pub fn octets(&self) -> usize {
        self.bits.div_ceil(8)
    }
}

/// What SDO information tells of an object.
#[derive(Clone, Copy, Debug)]
pub struct Description {
    /// Type of the entry.
    pub data_type: DataType,
    /// Octets of the value.
    pub octets: usize,
    /// Who may read and write it.
    pub access: Access,
    /// Where it may be mapped.
    pub pdo: PdoAccess,
    /// Its name.
    pub name: &'static str,
    /// Highest sub-index of the object.
    pub sub_max: u8,
}

/// All objects of a device.
#[derive(Clone, Debug)]
pub struct ObjectStore {
    places: Vec<Place>,
    check: WriteCheck,
}

impl Default for ObjectStore {
    fn default() -> ObjectStore {
        ObjectStore {
            places: Vec::new(),
            check: cia402::device::check_write,
        }
    }
}

impl ObjectStore {
    /// No objects.
    pub fn new() -> ObjectStore {
        ObjectStore::default()
    }

    /// Has SDO writes judged by `check`, in place of the rules of drives.
    pub fn set_write_check(&mut self, check: WriteCheck) {
        self.check = check;
    }

    /// Adds the objects of these tables, at the indices that they have plus `shift`; the number of the part.
    ///
    /// # Errors
    /// [`obd::BuildError`].
    pub fn add(
        &mut self,
        indices: RangeInclusive<u16>,
        shift: u16,
        tables: &[&'static [EntryDef]],
    ) -> Result<usize, obd::BuildError> {
        let part = Box::new(Dictionary::new(tables)?);
        self.places.push(Place { indices, shift, part });
        Ok(self.places.len() - 1)
    }

    /// A part, to be worked on as a whole.
    pub fn part_mut(&mut self, place: usize) -> &mut Part {
        &mut self.places[place].part
    }

    /// A part.
    pub fn part(&self, place: usize) -> &Part {
        &self.places[place].part
    }

    /// The part of an index, and the index there.
    fn locate(&self, index: u16) -> Result<(usize, u16), AbortCode> {
        let found = self.places.iter().position(|place| place.indices.contains(&index));
        let place = found.ok_or(AbortCode::NO_OBJECT)?;
        Ok((place, index.wrapping_sub(self.places[place].shift)))
    }

    /// Finds a value.
    ///
    /// # Errors
    /// [`AbortCode::NO_OBJECT`], [`AbortCode::NO_SUB_INDEX`].
    pub fn find(&self, index: u16, sub: u8) -> Result<ObjectRef, AbortCode> {
        let (place, inner) = self.locate(index)?;
        let handle = self.places[place].part.find(inner, sub)?;
        Ok(ObjectRef { place, handle })
    }

    /// Octets of a value.
    pub fn octets(&self, object: ObjectRef) -> &[u8] {
        self.places[object.place].part.octets(object.handle)
    }

    /// Sets a value as the device itself; one of another length is left out.
    pub fn set(&mut self, object: ObjectRef, octets: &[u8]) {
        let _ = self.places[object.place].part.set_octets(object.handle, octets);
    }

    /// Sets a value as the device itself, by its index.
    ///
    /// # Errors
    /// As [`ObjectStore::find`], and where the length is wrong.
    pub fn preset(&mut self, index: u16, sub: u8, octets: &[u8]) -> Result<(), AbortCode> {
        let object = self.find(index, sub)?;
        self.places[object.place].part.set_default(object.handle, octets)
    }

    /// Reads as SDO does.
    ///
    /// # Errors
    /// The abort code of the refusal.
    pub fn read(&self, index: u16, sub: u8) -> Result<&[u8], AbortCode> {
        let (place, inner) = self.locate(index)?;
        self.places[place].part.read(inner, sub)
    }

    /// Writes as SDO does; what the rules of process data and of the drive refuse, too.
    ///
    /// # Errors
    /// The abort code of the refusal.
    pub fn write(&mut self, index: u16, sub: u8, value: &[u8], in_pre_op: bool) -> Result<(), AbortCode> {
        let (place, inner) = self.locate(index)?;
        self.places[place].part.check_write(inner, sub, value)?;
        if is_set_up(index) {
            if !in_pre_op {
                return Err(AbortCode::DEVICE_STATE);
            }
            self.check_set_up(index, sub, value)?;
        }
        (self.check)(&self.places[place].part, inner, sub, value)?;
        self.places[place].part.write(inner, sub, value).map(|_| ())
    }

    /// A mapping or an assignment is written entry by entry while its number of entries is 0.
    fn check_set_up(&self, index: u16, sub: u8, value: &[u8]) -> Result<(), AbortCode> {
        if sub > 0 {
            return match self.read(index, 0)? {
                [0] => Ok(()),
                _ => Err(abort::SUB_0_NOT_ZERO),
            };
        }
        for entry in 1..=value[0] {
            if matches!(index, RX_ASSIGN | TX_ASSIGN) {
                let pdo = self.number(index, entry)?;
                let (first, last) = pdo_range(index == RX_ASSIGN);
                if !(first..=last).contains(&(pdo as u16)) || self.find(pdo as u16, 0).is_err() {
                    return Err(AbortCode::PARAMETER_INCOMPATIBLE);
                }
            } else {
                self.field(self.number(index, entry)?, index < 0x1A00, 0)?;
            }
        }
        Ok(())
    }

    /// A value of up to four octets as a number.
    fn number(&self, index: u16, sub: u8) -> Result<u32, AbortCode> {
        let octets = self.octets(self.find(index, sub)?);
        let mut wide = [0; 4];
        let count = octets.len().min(4);
        wide[..count].copy_from_slice(&octets[..count]);
        Ok(u32::from_le_bytes(wide))
    }

    /// The field of a mapping entry; `None`: a gap. And its length in bits.
    fn field(&self, entry: u32, receive: bool, bit: usize) -> Result<(Option<Field>, usize), AbortCode> {
        let (index, sub, bits) = ((entry >> 16) as u16, (entry >> 8) as u8, (entry & 0xFF) as usize);
        if index == 0 {
            return Ok((None, bits));
        }
        let object = self.find(index, sub)?;
        let def = self.places[object.place].part.def(object.handle);
        let fits_way = match def.pdo {
            PdoAccess::No => false,
            PdoAccess::Rpdo => receive,
            PdoAccess::Tpdo => !receive,
            PdoAccess::Both => true,
        };
        if !fits_way {
            return Err(AbortCode::NOT_MAPPABLE);
        }
        let expected = if def.data_type == DataType::Bool {
            1
        } else {
            8 * object.handle.size()
        };
        if bits != expected {
            return Err(AbortCode::PDO_LENGTH);
        }
        Ok((Some(Field { object, bit, bits }), bits))
    }

    /// Process data of a direction as they are assigned and mapped now.
    ///
    /// # Errors
    /// Why they cannot be.
    pub fn process_data(&self, receive: bool) -> Result<ProcessData, AbortCode> {
        let assign = if receive { RX_ASSIGN } else { TX_ASSIGN };
        let mut data = ProcessData::default();
        for position in 1..=self.number(assign, 0)? as u8 {
            let pdo = self.number(assign, position)? as u16;
            for entry in 1..=self.number(pdo, 0)? as u8 {
                let (field, bits) = self.field(self.number(pdo, entry)?, receive, data.bits)?;
                data.fields.extend(field);
                data.bits += bits;
            }
        }
        Ok(data)
    }

    /// Takes outputs from the memory.
    pub fn scatter(&mut self, data: &ProcessData, memory: &[u8]) {
        let mut value = [0; 8];
        for field in &data.fields {
            let octets = field.bits.div_ceil(8).min(8);
            value[..octets].fill(0);
            copy_bits(memory, field.bit, &mut value, 0, field.bits);
            self.set(field.object, &value[..octets]);
        }
    }

    /// Puts inputs into the memory.
    pub fn gather(&self, data: &ProcessData, memory: &mut [u8]) {
        for field in &data.fields {
            copy_bits(self.octets(field.object), 0, memory, field.bit, field.bits);
        }
    }

    /// All indices, in order.
    pub fn indices(&self) -> Vec<u16> {
        let mut indices: Vec<u16> = Vec::new();
        for place in &self.places {
            indices.extend(place.part.lines().map(|(index, _)| index.wrapping_add(place.shift)));
        }
        indices.retain(|index| self.locate(*index).is_ok());
        indices.sort_unstable();
        indices.dedup();
        indices
    }

    /// What an entry is.
    ///
    /// # Errors
    /// As [`ObjectStore::find`].
    pub fn describe(&self, index: u16, sub: u8) -> Result<Description, AbortCode> {
        let object = self.find(index, sub)?;
        let (_, inner) = self.locate(index)?;
        let part = &self.places[object.place].part;
        let def = part.def(object.handle);
        let subs = part
            .lines()
            .filter(|(line, _)| *line == inner)
            .map(|(_, def)| def.sub_last);
        Ok(Description {
            data_type: def.data_type,
            octets: self.octets(object).len(),
            access: def.access,
            pdo: def.pdo,
            name: def.name,
            sub_max: subs.max().unwrap_or(0),
        })
    }
}

/// Objects that say what is process data.
fn is_set_up(index: u16) -> bool {
    matches!(index, 0x1600..=0x17FF | 0x1A00..=0x1BFF | RX_ASSIGN | TX_ASSIGN)
}

fn pdo_range(receive: bool) -> (u16, u16) {
    if receive { (0x1600, 0x17FF) } else { (0x1A00, 0x1BFF) }
}

/// Copies bits, by octets where they lie so; what is not there is left out.
pub(super) fn copy_bits(from: &[u8], from_bit: usize, to: &mut [u8], to_bit: usize, bits: usize) {
    if [from_bit, to_bit, bits].iter().all(|bit| bit.is_multiple_of(8)) {
        let (from, to) = (from.get(from_bit / 8..), to.get_mut(to_bit / 8..));
        if let (Some(from), Some(to)) = (from, to) {
            let octets = (bits / 8).min(from.len()).min(to.len());
            to[..octets].copy_from_slice(&from[..octets]);
        }
        return;
    }
    for bit in 0..bits {
        let (source, target) = (from_bit + bit, to_bit + bit);
        let Some(octet) = from.get(source / 8) else { return };
        let value = octet >> (source % 8) & 1;
        let Some(octet) = to.get_mut(target / 8) else { return };
        *octet = *octet & !(1 << (target % 8)) | value << (target % 8);
    }
}
