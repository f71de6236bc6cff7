//! A file system that fails or crashes at every step in turn, and the one of the PC.

use super::*;
use std::collections::BTreeMap;

/// A disk with a cache before it: what was not forced may be lost at a crash, whole or in part.
#[derive(Clone, Debug, Default)]
struct Model {
    /// Content of each file that was ever made; on the disk is at least the part that was synced.
    contents: Vec<Content>,
    /// Names as everybody sees them.
    names: BTreeMap<PathBuf, usize>,
    /// Names as they were at each step since the folder was forced last: a crash leaves one of these.
    since_sync: Vec<BTreeMap<PathBuf, usize>>,
    steps: usize,
    /// At this step an error; with `crash` at every one behind it, too.
    fails_at: Option<usize>,
    crash: bool,
}

#[derive(Clone, Debug, Default)]
struct Content {
    octets: Vec<u8>,
    synced: bool,
}

impl Model {
    fn with(files: &[(&str, &str)]) -> Model {
        let mut model = Model::default();
        for (name, text) in files {
            model.contents.push(Content {
                octets: text.as_bytes().to_vec(),
                synced: true,
            });
            model.names.insert(PathBuf::from(name), model.contents.len() - 1);
        }
        model
    }

    fn step(&mut self) -> io::Result<()> {
        self.steps += 1;
        match self.fails_at {
            Some(at) if self.steps == at || self.crash && self.steps > at => Err(io::Error::other("no space left")),
            Some(_) | None => Ok(()),
        }
    }

    fn rename_all(&mut self, change: impl FnOnce(&mut BTreeMap<PathBuf, usize>)) {
        self.since_sync.push(self.names.clone());
        change(&mut self.names);
    }

    fn seen(&self, name: &str) -> Option<String> {
        let index = self.names.get(Path::new(name))?;
        Some(String::from_utf8(self.contents[*index].octets.clone()).unwrap())
    }

    /// All that a file may hold after a crash at this moment; `None`: it is not there.
    fn after_crash(&self, name: &str) -> Vec<Option<Vec<u8>>> {
        let mut found = Vec::new();
        for names in self.since_sync.iter().chain([&self.names]) {
            let Some(index) = names.get(Path::new(name)) else {
                found.push(None);
                continue;
            };
            let Content { octets, synced } = &self.contents[*index];
            let least = if *synced { octets.len() } else { 0 };
            found.extend((least..=octets.len()).map(|length| Some(octets[..length].to_vec())));
        }
        found
    }
}

impl Files for Model {
    type Writer = usize;
    type Lock = ();

    fn lock(&mut self, folder: &Path) -> io::Result<()> {
        assert_eq!(folder, Path::new("tables"));
        self.step()
    }

    fn read(&mut self, path: &Path) -> io::Result<Option<Vec<u8>>> {
        self.step()?;
        Ok(self.names.get(path).map(|index| self.contents[*index].octets.clone()))
    }

    fn create(&mut self, path: &Path, _like: &Path) -> io::Result<usize> {
        self.step()?;
        self.contents.push(Content::default());
        let index = self.contents.len() - 1;
        self.rename_all(|names| {
            names.insert(path.to_owned(), index);
        });
        Ok(index)
    }

    fn write(&mut self, writer: &mut usize, octets: &[u8]) -> io::Result<()> {
        let failed = self.step();
        let length = if failed.is_err() {
            octets.len() / 2
        } else {
            octets.len()
        };
        let content = &mut self.contents[*writer];
        content.octets.extend_from_slice(&octets[..length]);
        content.synced = false;
        failed
    }

    fn sync(&mut self, writer: &mut usize) -> io::Result<()> {
        self.step()?;
        self.contents[*writer].synced = true;
        Ok(())
    }

    fn rename(&mut self, from: &Path, to: &Path) -> io::Result<()> {
        self.step()?;
        self.rename_all(|names| {
            let index = names.remove(from).unwrap();
            names.insert(to.to_owned(), index);
        });
        Ok(())
    }

    fn sync_folder(&mut self, folder: &Path) -> io::Result<()> {
        assert_eq!(folder, Path::new("tables"));
        self.step()?;
        self.since_sync.clear();
        Ok(())
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        self.step()?;
        self.rename_all(|names| {
            names.remove(path);
        });
        Ok(())
    }
}

const FILE: &str = "tables/tool.tbl";
const BACKUP: &str = "tables/tool.tbl.bak";
const PATHS: [&str; 4] = [FILE, BACKUP, "tables/.tool.tbl.new", "tables/.tool.tbl.bak.new"];

#[test]
fn the_new_content_is_there_and_the_old_one_beside_it() {
    let mut model = Model::with(&[(FILE, "old"), (BACKUP, "older")]);
    assert!(replace(&mut model, Path::new(FILE), b"new").unwrap());
    assert_eq!(
        PATHS.map(|path| model.seen(path)),
        [Some("new".into()), Some("old".into()), None, None]
    );
    assert_eq!(model.after_crash(FILE), [Some(b"new".to_vec())], "it is on the disk");

    let steps = model.steps;
    assert!(!replace(&mut model, Path::new(FILE), b"new").unwrap());
    assert_eq!(model.steps, steps + 2, "only looked at");
    assert_eq!(model.seen(BACKUP), Some("old".into()));

    let mut model = Model::with(&[]);
    assert!(replace(&mut model, Path::new(FILE), b"new").unwrap());
    assert_eq!(
        PATHS.map(|path| model.seen(path)),
        [Some("new".into()), None, None, None]
    );
}

/// Steps of one replacement: lock, read, two files of create, write, sync, rename, sync of the folder.
const STEPS: usize = 2 + 2 * 5;

#[test]
fn a_crash_at_any_step_leaves_the_old_content_or_the_new_one() {
    let mut both = [false; 2];
    for at in 1..=STEPS {
        let mut model = Model::with(&[(FILE, "old content"), (BACKUP, "older content")]);
        model.fails_at = Some(at);
        model.crash = true;
        replace(&mut model, Path::new(FILE), b"new content").unwrap_err();
        for found in model.after_crash(FILE) {
            let is_new = found.as_deref() == Some(b"new content");
            assert!(
                is_new || found.as_deref() == Some(b"old content"),
                "step {at}: {found:?}"
            );
            both[usize::from(is_new)] = true;
        }
        for found in model.after_crash(BACKUP) {
            let backup = found.expect("a backup");
            assert!(
                backup == b"old content" || backup == b"older content",
                "step {at}: {backup:?}"
            );
        }
    }
    assert_eq!(both, [true, true]);
}

#[test]
fn an_error_at_any_step_is_told_and_leaves_no_half_file() {
    for at in 1..=STEPS {
        let mut model = Model::with(&[(FILE, "old")]);
        model.fails_at = Some(at);
        let error = replace(&mut model, Path::new(FILE), b"new").unwrap_err();
        assert_eq!(error.to_string(), "no space left");
        let expected = if at == STEPS { "new" } else { "old" };
        assert_eq!(model.seen(FILE).as_deref(), Some(expected), "step {at}");
        assert_eq!(
            PATHS[2..].iter().filter(|path| model.seen(path).is_some()).count(),
            0,
            "step {at}"
        );
    }
    let mut model = Model::with(&[(FILE, "old")]);
    model.fails_at = Some(STEPS + 1);
    assert!(replace(&mut model, Path::new(FILE), b"new").unwrap());
}

#[test]
fn the_model_finds_what_forcing_prevents() {
    // A file that is written in place, and one that is renamed before it is forced.
    let mut model = Model::with(&[(FILE, "old")]);
    let mut writer = model.create(Path::new(FILE), Path::new(FILE)).unwrap();
    model.write(&mut writer, b"new").unwrap();
    assert!(model.after_crash(FILE).contains(&Some(b"n".to_vec())));
    let mut model = Model::with(&[(FILE, "old")]);
    let mut writer = model.create(Path::new("tables/x"), Path::new(FILE)).unwrap();
    model.write(&mut writer, b"new").unwrap();
    model.rename(Path::new("tables/x"), Path::new(FILE)).unwrap();
    assert!(model.after_crash(FILE).contains(&Some(Vec::new())));
}

#[test]
fn on_the_disk_rights_stay_and_a_missing_folder_is_told() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("machine.var");
    assert!(replace(&mut Disk, &path, b"one").unwrap());
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o640)).unwrap();
    assert!(replace(&mut Disk, &path, b"two").unwrap());
    assert!(!replace(&mut Disk, &path, b"two").unwrap());
    assert_eq!(std::fs::read(&path).unwrap(), b"two");
    assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
    let backup = folder.path().join("machine.var.bak");
    assert_eq!(std::fs::read(&backup).unwrap(), b"one");
    assert_eq!(std::fs::metadata(&backup).unwrap().permissions().mode() & 0o777, 0o640);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);

    let nowhere = folder.path().join("no/machine.var");
    assert_eq!(
        replace(&mut Disk, &nowhere, b"x").unwrap_err().kind(),
        io::ErrorKind::NotFound
    );
}
