//! A PostgreSQL cluster of the test's own, gone with it.

use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use tempfile::TempDir;

/// A running server that listens on a socket in its own folder.
pub(super) struct Cluster {
    folder: TempDir,
    server: Child,
    databases: std::cell::Cell<u32>,
}

/// Who runs the server when the tests run as root, which the server refuses.
const OTHER_USERS: [&str; 2] = ["postgres", "nobody"];

fn binaries() -> Option<PathBuf> {
    let installed = std::fs::read_dir("/usr/lib/postgresql").into_iter().flatten().flatten().map(|entry| entry.path().join("bin"));
    let found = installed.chain([PathBuf::from("/usr/local/bin"), PathBuf::from("/usr/bin")]);
    found.filter(|folder| folder.join("initdb").exists() && folder.join("postgres").exists()).max()
}

/// User and group for the server; none to run it as ourselves.
fn other_user() -> Option<(u32, u32)> {
    use std::os::unix::fs::MetadataExt as _;
    if std::fs::metadata("/proc/self").ok()?.uid() != 0 {
        return None;
    }
    let users = std::fs::read_to_string("/etc/passwd").ok()?;
    OTHER_USERS.iter().find_map(|name| {
        let fields: Vec<&str> = users.lines().find(|line| line.split(':').next() == Some(name))?.split(':').collect();
        Some((fields.get(2)?.parse().ok()?, fields.get(3)?.parse().ok()?))
    })
}

fn program(path: &Path, user: Option<(u32, u32)>) -> Command {
    let mut command = Command::new(path);
    if let Some((uid, gid)) = user {
        command.uid(uid).gid(gid);
    }
    command.stdout(Stdio::null()).stderr(Stdio::null()).stdin(Stdio::null()).current_dir("/");
    command
}

fn serve(binaries: &Path, folder: &TempDir, user: Option<(u32, u32)>) -> Child {
    let mut server = program(&binaries.join("postgres"), user);
    server.arg("-D").arg(folder.path().join("data")).arg("-k").arg(folder.path());
    server.args(["-c", "listen_addresses=", "-c", "shared_buffers=16MB"]).spawn().unwrap()
}

impl Cluster {
    /// Starts one; none where PostgreSQL is not installed, and says so.
    pub(super) fn start() -> Option<Self> {
        let Some(binaries) = binaries() else {
            eprintln!("skipped: PostgreSQL is not installed (apt-get install postgresql)");
            return None;
        };
        let (folder, user) = (tempfile::tempdir().unwrap(), other_user());
        if let Some((uid, gid)) = user {
            std::os::unix::fs::chown(folder.path(), Some(uid), Some(gid)).unwrap();
        }
        let data = folder.path().join("data");
        let mut initdb = program(&binaries.join("initdb"), user);
        let made = initdb.args(["--auth=trust", "--username=tender", "--no-sync", "-D"]).arg(&data).status().unwrap();
        assert!(made.success(), "initdb: {made}");
        let server = serve(&binaries, &folder, user);
        Some(Self { folder, server, databases: std::cell::Cell::new(0) })
    }

    /// Stops the server in order.
    pub(super) fn stop(&mut self) {
        let asked = Command::new("kill").arg("-INT").arg(self.server.id().to_string()).status().unwrap();
        assert!(asked.success());
        self.server.wait().unwrap();
    }

    /// Starts it again.
    pub(super) fn begin_again(&mut self) {
        self.server = serve(&binaries().expect("it was there"), &self.folder, other_user());
    }

    /// The address of a database.
    fn address(&self, database: &str) -> PathBuf {
        PathBuf::from(format!("postgres://tender@localhost/{database}?host={}", self.folder.path().display()))
    }

    /// The address of a new, empty database.
    pub(super) async fn database(&self) -> PathBuf {
        let number = self.databases.replace(self.databases.get() + 1);
        let name = format!("site{number}");
        let address = self.address("postgres");
        let options = super::super::place::any(address.to_str().unwrap()).unwrap();
        let mut waited_ms = 0;
        let pool = loop {
            // The server needs a moment to come up.
            match sqlx::any::AnyPoolOptions::new().max_connections(1).connect_with(options.clone()).await {
                Ok(pool) => break pool,
                Err(error) if waited_ms > 30_000 => panic!("the server does not come up: {error}"),
                Err(_) => tokio::time::sleep(std::time::Duration::from_millis(100)).await,
            }
            waited_ms += 100;
        };
        sqlx::query(sqlx::AssertSqlSafe(format!("CREATE DATABASE {name}"))).execute(&pool).await.unwrap();
        pool.close().await;
        self.address(&name)
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        // SIGKILL leaves the children to notice by themselves; the data is not needed any more.
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}
