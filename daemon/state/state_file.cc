#include "daemon/state/state_file.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <utility>

#include "absl/strings/str_cat.h"

namespace voxeld::daemon::state {
namespace {

constexpr const char* kBeside[] = {"", "-wal", "-journal", "-shm"};

// The table definition as SQLite stores it after CREATE TABLE.
constexpr char kTable[] =
    "rows("
    "kind INTEGER NOT NULL, owner INTEGER NOT NULL, name BLOB NOT NULL, id BLOB NOT NULL,"
    "bytes BLOB NOT NULL, PRIMARY KEY(kind, owner, name, id)) WITHOUT ROWID";

bool IsDamage(int code) {
  const int primary = code & 0xff;
  return primary == SQLITE_CORRUPT || primary == SQLITE_NOTADB || primary == SQLITE_FORMAT;
}

}  // namespace

struct StateFile::Statements {
  explicit Statements(sqlite3* database) : database(database) {}
  ~Statements() {
    for (sqlite3_stmt* statement : all) sqlite3_finalize(statement);
  }

  int Make(size_t which, const char* sql) {
    return sqlite3_prepare_v3(database, sql, -1, SQLITE_PREPARE_PERSISTENT, &all[which], nullptr);
  }

  sqlite3* const database;
  enum { kRead, kPut, kRemove, kRemoveNamed, kBegin, kCommit, kCount };
  std::array<sqlite3_stmt*, kCount> all = {};
};

StateFile::StateFile(StateFileOptions options) : options_(std::move(options)) {}
StateFile::~StateFile() { Close(); }

void StateFile::Close() {
  statements_.reset();
  if (database_ != nullptr) sqlite3_close(database_);
  database_ = nullptr;
}

absl::Status StateFile::Fault(int code, const char* what) const {
  const std::string text =
      absl::StrCat("the state file ", options_.path, ": ", what, ": ",
                   database_ == nullptr ? sqlite3_errstr(code) : sqlite3_errmsg(database_));
  if (IsDamage(code)) return absl::DataLossError(text);
  switch (code & 0xff) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return absl::AlreadyExistsError(
          absl::StrCat(text, "; another daemon has it: give each its own folder, [state] dir"));
    case SQLITE_FULL:
      return absl::ResourceExhaustedError(absl::StrCat(text, "; make room on its disk"));
    default:
      return absl::UnavailableError(text);
  }
}

absl::Status StateFile::Run(const char* sql) {
  const int code = sqlite3_exec(database_, sql, nullptr, nullptr, nullptr);
  return code == SQLITE_OK ? absl::OkStatus() : Fault(code, sql);
}

absl::StatusOr<std::unique_ptr<StateFile>> StateFile::Open(StateFileOptions options) {
  std::unique_ptr<StateFile> file(new StateFile(std::move(options)));
  const bool was_there = access(file->options_.path.c_str(), F_OK) == 0;
  absl::Status status = file->OpenDatabase();
  if (absl::IsDataLoss(status)) status = file->StartAnew(std::string(status.message()));
  struct stat info {};
  if (!status.ok() && !was_there && stat(file->options_.path.c_str(), &info) == 0 &&
      info.st_size == 0) {
    unlink(
        file->options_.path.c_str());  // otherwise the next start would take it for a truncated one
  }
  if (!status.ok()) return status;
  return file;
}

absl::Status StateFile::OpenDatabase() {
  if (options_.vfs.empty()) {
    // SQLite would create the file readable for everybody. The files beside it inherit its mode.
    constexpr int kFlags = O_RDWR | O_CLOEXEC | O_NOFOLLOW;
    int file = open(options_.path.c_str(), kFlags | O_CREAT | O_EXCL, 0600);
    const bool was_there = file < 0 && errno == EEXIST;
    if (was_there) file = open(options_.path.c_str(), kFlags);
    if (file < 0) return absl::ErrnoToStatus(errno, absl::StrCat("the state file ", options_.path));
    struct stat info {};
    const bool is_empty = was_there && fstat(file, &info) == 0 && info.st_size == 0;
    close(file);
    // SQLite would treat it as a new file, and the loss would go unnoticed.
    if (is_empty) return absl::DataLossError("it is empty, as if it had been truncated");
  }
  int code = sqlite3_open_v2(
      options_.path.c_str(), &database_,
      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE,
      options_.vfs.empty() ? nullptr : options_.vfs.c_str());
  if (code != SQLITE_OK) return Fault(code, "open");
  // Only one process uses the file, so the index of the write-ahead log stays in its memory.
  for (const char* sql :
       {"PRAGMA locking_mode=EXCLUSIVE", "PRAGMA mmap_size=0", "PRAGMA trusted_schema=OFF",
        "PRAGMA cell_size_check=ON", "PRAGMA journal_mode=WAL", "PRAGMA synchronous=FULL",
        "BEGIN EXCLUSIVE; COMMIT"}) {
    if (absl::Status status = Run(sql); !status.ok()) return status;
  }
  return Prepare();
}

absl::Status StateFile::Prepare() {
  const auto number = [&](const char* sql, int64_t* out) {
    sqlite3_stmt* statement = nullptr;
    int code = sqlite3_prepare_v2(database_, sql, -1, &statement, nullptr);
    if (code == SQLITE_OK) {
      code = sqlite3_step(statement);
      if (code == SQLITE_ROW) {
        *out = sqlite3_column_int64(statement, 0);
        code = SQLITE_OK;
      }
    }
    sqlite3_finalize(statement);
    return code == SQLITE_OK ? absl::OkStatus() : Fault(code, sql);
  };
  int64_t application = 0, version = 0, tables = 0;
  absl::Status status = number("PRAGMA application_id", &application);
  if (status.ok()) status = number("PRAGMA user_version", &version);
  if (status.ok()) status = number("SELECT count(*) FROM sqlite_schema", &tables);
  if (!status.ok()) return status;
  if (application != kApplicationId && (application != 0 || tables != 0)) {
    return absl::FailedPreconditionError(absl::StrCat(
        options_.path,
        " is a database of something else; move it away, or give another folder, [state] dir"));
  }
  if (version > kVersion) {
    return absl::FailedPreconditionError(
        absl::StrCat(options_.path, " has the format ", version, ", and this version knows up to ",
                     kVersion, "; run the version that made it, or move it away"));
  }
  if (tables == 0) {
    const std::string sql = absl::StrCat("BEGIN IMMEDIATE;CREATE TABLE ", kTable,
                                         ";PRAGMA application_id=", kApplicationId,
                                         ";PRAGMA user_version=", kVersion, ";COMMIT");
    if (status = Run(sql.c_str()); !status.ok()) return status;
  } else {
    // Foreign triggers, views and constraints could change what is stored.
    int64_t ours = 0;
    const std::string sql =
        absl::StrCat("SELECT count(*) FROM sqlite_schema WHERE type='table' AND sql='CREATE TABLE ",
                     kTable, "'");
    if (status = number(sql.c_str(), &ours); !status.ok()) return status;
    if (tables != 1 || ours != 1) {
      return absl::DataLossError(absl::StrCat("the state file ", options_.path, ": of its ", tables,
                                              " tables, indices, views and triggers ", ours,
                                              " is as it was made; one alone is to be there"));
    }
  }
  statements_ = std::make_unique<Statements>(database_);
  for (const auto& [which, sql] :
       {std::pair(Statements::kRead,
                  "SELECT kind, owner, name, id, bytes FROM rows ORDER BY kind, owner, name, id"),
        {Statements::kPut, "INSERT OR REPLACE INTO rows VALUES(?1, ?2, ?3, ?4, ?5)"},
        {Statements::kRemove,
         "DELETE FROM rows WHERE kind = ?1 AND owner = ?2 AND name = ?3 AND id = ?4"},
        {Statements::kRemoveNamed, "DELETE FROM rows WHERE kind = ?1 AND owner = ?2 AND name = ?3"},
        {Statements::kBegin, "BEGIN IMMEDIATE"},
        {Statements::kCommit, "COMMIT"}}) {
    if (const int code = statements_->Make(which, sql); code != SQLITE_OK) return Fault(code, sql);
  }
  // A page that could not be read, or an allocation that failed, is reported like a damaged page,
  // so check again before reporting damage.
  status = Check();
  return absl::IsDataLoss(status) ? Check() : status;
}

// Checks every page and the order of the index before the content is used.
absl::Status StateFile::Check() {
  sqlite3_stmt* check = nullptr;
  int code = sqlite3_prepare_v2(database_, "PRAGMA integrity_check(1)", -1, &check, nullptr);
  if (code == SQLITE_OK) code = sqlite3_step(check);
  std::string found;
  if (code == SQLITE_ROW) {
    const unsigned char* text = sqlite3_column_text(check, 0);
    if (text == nullptr) code = SQLITE_NOMEM;
    if (text != nullptr) found = reinterpret_cast<const char*>(text);
  }
  sqlite3_finalize(check);
  if (code != SQLITE_ROW) return Fault(code, "checking it");
  if (found == "ok") return absl::OkStatus();
  return absl::DataLossError(absl::StrCat("the state file ", options_.path, ": ", found));
}

absl::Status StateFile::PutAside(const std::string& why) {
  Close();
  const std::string aside = absl::StrCat(options_.path, ".damaged-", options_.now());
  for (const char* beside : kBeside) {
    const std::string from = absl::StrCat(options_.path, beside);
    if (access(from.c_str(), F_OK) != 0) continue;
    if (rename(from.c_str(), absl::StrCat(aside, beside).c_str()) != 0) {
      return absl::ErrnoToStatus(errno, absl::StrCat(from, " cannot be put aside"));
    }
  }
  quarantined_ = absl::StrCat(aside, ": ", why);
  return absl::OkStatus();
}

absl::Status StateFile::StartAnew(const std::string& why) {
  if (absl::Status status = PutAside(why); !status.ok()) return status;
  return OpenDatabase();
}

absl::Status StateFile::Read(const std::function<void(const RowKey&, std::string_view)>& row) {
  if (statements_ == nullptr) return absl::FailedPreconditionError("the state file is closed");
  sqlite3_stmt* const read = statements_->all[Statements::kRead];
  const auto bytes = [&](int column) {
    const auto* data = static_cast<const char*>(sqlite3_column_blob(read, column));
    return std::string_view(data == nullptr ? "" : data,
                            static_cast<size_t>(sqlite3_column_bytes(read, column)));
  };
  int code = SQLITE_ROW;
  while ((code = sqlite3_step(read)) == SQLITE_ROW) {
    RowKey key;
    key.kind = static_cast<RowKind>(sqlite3_column_int64(read, 0));
    key.owner = static_cast<uint64_t>(sqlite3_column_int64(read, 1));
    key.name = std::string(bytes(2));
    key.id = std::string(bytes(3));
    row(key, bytes(4));
  }
  sqlite3_reset(read);
  return code == SQLITE_DONE ? absl::OkStatus() : Fault(code, "reading it");
}

absl::Status StateFile::Carry(const Change& change) {
  const auto run = [&](size_t which, const RowKey& key, const std::string* bytes) {
    sqlite3_stmt* const statement = statements_->all[which];
    const auto blob = [&](int at, const std::string& text) {
      return sqlite3_bind_blob64(statement, at, text.data(), text.size(), SQLITE_STATIC);
    };
    int code = sqlite3_bind_int64(statement, 1, static_cast<int64_t>(key.kind));
    if (code == SQLITE_OK) {
      code = sqlite3_bind_int64(statement, 2, static_cast<int64_t>(key.owner));
    }
    if (code == SQLITE_OK) code = blob(3, key.name);
    if (code == SQLITE_OK && which != Statements::kRemoveNamed) code = blob(4, key.id);
    if (code == SQLITE_OK && bytes != nullptr) code = blob(5, *bytes);
    if (code == SQLITE_OK) code = sqlite3_step(statement);
    absl::Status status = code == SQLITE_DONE ? absl::OkStatus() : Fault(code, "writing it");
    sqlite3_reset(statement);
    sqlite3_clear_bindings(statement);
    return status;
  };
  RowKey key = change.key;
  switch (change.what) {
    case Change::What::kPut:
      return run(Statements::kPut, key, &change.bytes);
    case Change::What::kRemove:
      return run(Statements::kRemove, key, nullptr);
    case Change::What::kRemoveLayer: {
      key.kind = RowKind::kLayer;
      if (absl::Status status = run(Statements::kRemoveNamed, key, nullptr); !status.ok()) {
        return status;
      }
      key.kind = RowKind::kEntity;
      return run(Statements::kRemoveNamed, key, nullptr);
    }
    case Change::What::kRemoveAll:
      return Run("DELETE FROM rows");
  }
  return absl::InternalError("a change of no kind");
}

absl::Status StateFile::Apply(const Source& next) {
  if (statements_ == nullptr) return absl::FailedPreconditionError("the state file is closed");
  const auto step = [&](size_t which, const char* what) {
    sqlite3_stmt* const statement = statements_->all[which];
    const int code = sqlite3_step(statement);
    absl::Status status = code == SQLITE_DONE ? absl::OkStatus() : Fault(code, what);
    sqlite3_reset(statement);
    return status;
  };
  absl::Status status = step(Statements::kBegin, "beginning a transaction");
  while (status.ok()) {
    const std::vector<Change> changes = next();
    if (changes.empty()) break;
    for (const Change& change : changes) {
      status = Carry(change);
      if (!status.ok()) break;
    }
  }
  if (status.ok()) status = step(Statements::kCommit, "committing a transaction");
  // Some errors have already rolled back the transaction.
  if (!status.ok() && sqlite3_get_autocommit(database_) == 0) {
    sqlite3_exec(database_, "ROLLBACK", nullptr, nullptr, nullptr);
  }
  return status;
}

}  // namespace voxeld::daemon::state
