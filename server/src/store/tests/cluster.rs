//! PostgreSQL for the tests of this program: alone on a new data directory, on a socket in it,
//! ended and removed with the program. Each data directory of a server has a database of its own.
//! Where PostgreSQL is not installed, the tests say so and pass, unless
//! `WAYMARK_REQUIRE_POSTGRES=1`.

use crate::store::{pictures, postgres::schema};
use std::{
    collections::BTreeSet,
    fs,
    os::unix::fs::{MetadataExt as _, chown},
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    sync::Mutex,
};
use tokio::sync::OnceCell;

/// A program of PostgreSQL: on the path, or where Debian has it.
fn program(name: &str) -> Option<PathBuf> {
    let on_path = std::env::var_os("PATH").unwrap_or_default();
    let versions = fs::read_dir("/usr/lib/postgresql").into_iter().flatten().flatten();
    let versions = versions.map(|version| version.path().join("bin"));
    std::env::split_paths(&on_path).chain(versions).map(|folder| folder.join(name)).find(|file| file.exists())
}

/// Whether this process is of root, who owns the files that it makes.
fn is_root() -> bool {
    tempfile::tempfile().unwrap().metadata().unwrap().uid() == 0
}

/// The number of the user `postgres`.
fn number_of_user() -> Option<u32> {
    let said = Command::new("id").args(["-u", "postgres"]).output().ok()?;
    String::from_utf8_lossy(&said.stdout).trim().parse().ok()
}

/// A data directory of PostgreSQL, with our tables in its template for new databases.
pub(crate) struct Cluster {
    folder: PathBuf,
    /// Ends PostgreSQL when its input is closed.
    watcher: Option<Child>,
    databases: Mutex<BTreeSet<String>>,
}

impl Drop for Cluster {
    fn drop(&mut self) {
        if let Some(mut watcher) = self.watcher.take() {
            drop(watcher.stdin.take());
            watcher.wait().ok();
        }
    }
}

impl Cluster {
    /// A new one, which does not run. `None` where PostgreSQL is not installed.
    pub(crate) async fn new() -> Option<Self> {
        if program("initdb").is_none() {
            let is_required = std::env::var("WAYMARK_REQUIRE_POSTGRES").is_ok_and(|value| value == "1");
            assert!(!is_required, "WAYMARK_REQUIRE_POSTGRES=1, and PostgreSQL is not installed");
            println!("skipped: no PostgreSQL");
            return None;
        }
        let folder = tempfile::tempdir().unwrap().keep();
        if is_root() {
            chown(&folder, number_of_user(), None).unwrap();
        }
        let mut cluster = Self { folder, watcher: None, databases: Mutex::default() };
        // Ends PostgreSQL, if it was started, and removes everything.
        let watch =
            "read -r nothing; test -e data/postmaster.pid && \"$1\" -D data -m immediate stop; rm -rf \"$2\"";
        let mut watcher = cluster.command("sh");
        watcher.args(["-c", watch, "sh"]).arg(program("pg_ctl").unwrap()).arg(&cluster.folder);
        watcher.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null());
        cluster.watcher = Some(watcher.spawn().unwrap());
        cluster.ran(
            "initdb",
            &["-E", "UTF8", "--locale=C", "-A", "trust", "-U", "postgres", "-N", "-D", "data"],
        );
        let errors = cluster.errors("template1", &schema::made().await.unwrap());
        assert!(errors.is_empty(), "{}", errors.join("\n"));
        Some(cluster)
    }

    /// A command that runs in its folder: as the user `postgres`, whom the folder is given to,
    /// where the tests run as root, which PostgreSQL refuses.
    fn command(&self, name: &str) -> Command {
        let program = program(name).unwrap_or_else(|| panic!("{name} is not installed"));
        let mut command = Command::new(&program);
        if is_root() {
            command = Command::new("setpriv");
            command.args(["--reuid=postgres", "--regid=postgres", "--init-groups"]).arg(&program);
        }
        command.current_dir(&self.folder);
        command
    }

    /// What a command has said, which must not fail.
    pub(super) fn ran(&self, name: &str, arguments: &[&str]) -> Output {
        let ran = self.command(name).args(arguments).output().unwrap();
        assert!(ran.status.success(), "{name}: {}", String::from_utf8_lossy(&ran.stderr));
        ran
    }

    /// Starts it.
    pub(crate) fn start(&self) {
        let folder = self.folder.display();
        let options = format!("-k {folder} -c listen_addresses= -c max_connections=400");
        self.ran("pg_ctl", &["-D", "data", "-w", "-l", "log", "-o", &options, "start"]);
    }

    /// Stops it and ends all connections.
    pub(crate) fn stop(&self) {
        self.ran("pg_ctl", &["-D", "data", "-w", "-m", "fast", "stop"]);
    }

    /// The address of the database for a data directory of a server. It is made first, of a
    /// template of the cluster.
    fn database_of(&self, data: &Path, template: &str) -> String {
        let text = data.as_os_str().as_encoded_bytes();
        let name = format!("t{}", pictures::hex(&pictures::digest(text)[..12]));
        if self.databases.lock().unwrap().insert(name.clone()) {
            let folder = self.folder.to_string_lossy();
            self.ran("createdb", &["-h", &folder, "-U", "postgres", "-T", template, &name]);
        }
        format!("postgres://postgres@localhost/{name}?host={}", self.folder.display())
    }

    /// A file in its data directory.
    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.folder.join("data").join(name)
    }

    /// Runs statements in order, while it does not run, and returns the first errors, each with its
    /// statement.
    pub(super) fn errors(&self, database: &str, statements: &[String]) -> Vec<String> {
        let script = self.folder.join("script.sql");
        fs::write(&script, statements.join(";\n\n") + ";\n\n").unwrap();
        let mut postgres = self.command("postgres");
        postgres.args([
            "--single",
            "-j",
            "-F",
            "-c",
            "log_min_error_statement=error",
            "-c",
            "log_line_prefix=",
        ]);
        let ran = postgres
            .args(["-D", "data", database])
            .stdin(fs::File::open(&script).unwrap())
            .stdout(Stdio::null())
            .output()
            .unwrap();
        let said = format!("\n{}", String::from_utf8_lossy(&ran.stderr));
        assert!(ran.status.success(), "{said}");
        let found =
            said.split("\nERROR: ").skip(1).map(|error| error.split("\nLOG: ").next().unwrap_or_default());
        found.take(5).map(str::to_owned).collect()
    }
}

tokio::task_local! {
    /// Where a test has its databases.
    static IN: &'static Cluster;
}

/// The cluster of this program.
static SHARED: OnceCell<Option<Cluster>> = OnceCell::const_new();

/// Runs a test whose servers store in PostgreSQL.
pub(crate) async fn on_postgres(test: impl Future<Output = ()>) {
    let started = async || {
        let cluster = Cluster::new().await?;
        cluster.start();
        Some(cluster)
    };
    if let Some(cluster) = SHARED.get_or_init(started).await {
        Box::pin(on_cluster(cluster, test)).await;
    }
}

/// Runs a test on a cluster of its own.
pub(crate) async fn on_cluster(cluster: &'static Cluster, test: impl Future<Output = ()>) {
    IN.scope(cluster, Box::pin(test)).await;
}

/// The setting `store` of a server with this data directory.
pub(crate) fn store_of(data: &Path) -> String {
    IN.try_with(|cluster| cluster.database_of(data, "template1")).unwrap_or_default()
}

/// The address of a database without tables.
pub(crate) fn empty_store(data: &Path) -> String {
    IN.with(|cluster| cluster.database_of(data, "template0"))
}

/// Has each test run on SQLite, and again on PostgreSQL. A test that is not listed is not used,
/// which the compiler says.
macro_rules! on_each_store {
    ($($test:ident),+ $(,)?) => {
        mod on_sqlite {
            $(#[tokio::test]
            async fn $test() {
                super::$test().await;
            })+
        }
        mod on_postgres {
            $(#[tokio::test]
            async fn $test() {
                $crate::store::tests::cluster::on_postgres(Box::pin(super::$test())).await;
            })+
        }
    };
}
pub(crate) use on_each_store;
