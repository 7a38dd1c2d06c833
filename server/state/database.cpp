#include "server/state/database.h"

#include <fmt/format.h>
#include <sqlite3.h>

#include <array>
#include <cstring>
#include <utility>

#include "common/sha256.h"

namespace radiosity::state {
namespace {

struct Finalize {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Statement = std::unique_ptr<sqlite3_stmt, Finalize>;

int bind(sqlite3_stmt* statement, int place, const Value& value) {
  if (const auto* number = std::get_if<std::int64_t>(&value)) return sqlite3_bind_int64(statement, place, *number);
  if (const auto* real = std::get_if<double>(&value)) return sqlite3_bind_double(statement, place, *real);
  const auto& text = std::get<std::string>(value);
  return sqlite3_bind_text64(statement, place, text.data(), text.size(), SQLITE_STATIC, SQLITE_UTF8);
}

Value column(sqlite3_stmt* statement, int place) {
  switch (sqlite3_column_type(statement, place)) {
    case SQLITE_INTEGER:
      return std::int64_t{sqlite3_column_int64(statement, place)};
    case SQLITE_FLOAT:
      return sqlite3_column_double(statement, place);
    default: {
      const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement, place));
      const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement, place));
      return text == nullptr ? std::string() : std::string(text, size);
    }
  }
}

bool isDamage(int code) { return (code & 0xff) == SQLITE_CORRUPT || (code & 0xff) == SQLITE_NOTADB; }

/// The system's reason for the last write to the log or to the database that failed; 0: there was none. (SQLite passes
/// it on for files that it cannot open alone.)
int lastErrno(sqlite3* handle) {
  int number = 0;
  sqlite3_file* log = nullptr;
  (void)sqlite3_file_control(handle, "main", SQLITE_FCNTL_JOURNAL_POINTER, &log);
  if (log != nullptr && log->pMethods != nullptr)
    (void)log->pMethods->xFileControl(log, SQLITE_FCNTL_LAST_ERRNO, &number);
  if (number == 0) (void)sqlite3_file_control(handle, "main", SQLITE_FCNTL_LAST_ERRNO, &number);
  return number;
}

std::string digestOf(const std::string& table, std::span<const Value> row) {
  std::string all = table;
  for (const auto& value : row) {
    if (const auto* number = std::get_if<std::int64_t>(&value)) all += fmt::format("|i{}", *number);
    if (const auto* real = std::get_if<double>(&value)) all += fmt::format("|d{:a}", *real);
    if (const auto* text = std::get_if<std::string>(&value)) all += fmt::format("|s{}:{}", text->size(), *text);
  }
  return sha256Hex(std::string_view(all));
}

}  // namespace

void Database::Close::operator()(sqlite3* handle) const { sqlite3_close_v2(handle); }

tl::unexpected<Error> Database::failure(int code) const {
  const std::string why = handle_ ? sqlite3_errmsg(handle_.get()) : sqlite3_errstr(code);
  if (isDamage(code))
    return fail(ErrorCode::kBadInput,
                why + "; put a backup of the whole folder in its place, or move the folder away to start anew",
                file_.string());
  // "disk I/O error" alone does not tell a limit on the size of files from a disk that fails.
  const int number = (code & 0xff) == SQLITE_IOERR && handle_ ? lastErrno(handle_.get()) : 0;
  if (number != 0) return fail(ErrorCode::kUnavailable, why + ": " + std::strerror(number), file_.string());
  const bool busy = (code & 0xff) == SQLITE_BUSY || (code & 0xff) == SQLITE_LOCKED;
  return fail(ErrorCode::kUnavailable, busy ? "another program has it open (" + why + ")" : why, file_.string());
}

Result<Database> Database::open(const std::filesystem::path& file) {
  Database database(file);
  sqlite3* handle = nullptr;
  const int opened = sqlite3_open_v2(file.c_str(), &handle, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr);
  database.handle_.reset(handle);
  if (opened != SQLITE_OK) return database.failure(opened);
  sqlite3_extended_result_codes(handle, 1);
  if (sqlite3_db_readonly(handle, "main") == 1)
    return fail(ErrorCode::kUnavailable, "cannot be written; the state needs a folder that can", file.string());
  // Exclusive: the index of the log is in memory, where a full disk cannot take it away under our feet.
  constexpr std::array kPragmas = {"PRAGMA locking_mode=EXCLUSIVE", "PRAGMA journal_mode=WAL",
                                   "PRAGMA synchronous=FULL", "PRAGMA trusted_schema=OFF"};
  for (const auto* pragma : kPragmas) {
    if (auto set = database.run(pragma); !set) return tl::unexpected(set.error());
  }
  return database;
}

Result<FileIdentity> Database::identity() const {
  const auto there = identityOf(file_);
  int moved = 0;
  (void)sqlite3_file_control(handle_.get(), "main", SQLITE_FCNTL_HAS_MOVED, &moved);
  if (there && moved != 0) return fail(ErrorCode::kUnavailable, "was replaced while it was opened", file_.string());
  return there;
}

void Database::keepLog() { (void)sqlite3_db_config(handle_.get(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr); }

Result<std::vector<Row>> Database::rows(const std::string& sql, std::span<const Value> values) {
  sqlite3_stmt* made = nullptr;
  int code = sqlite3_prepare_v2(handle_.get(), sql.data(), static_cast<int>(sql.size()), &made, nullptr);
  const Statement statement(made);
  for (std::size_t i = 0; code == SQLITE_OK && i < values.size(); ++i)
    code = bind(made, static_cast<int>(i) + 1, values[i]);
  if (code != SQLITE_OK) return failure(code);
  std::vector<Row> found;
  while ((code = sqlite3_step(made)) == SQLITE_ROW) {
    auto& row = found.emplace_back();
    for (int i = 0; i < sqlite3_column_count(made); ++i) row.push_back(column(made, i));
  }
  if (code != SQLITE_DONE) return failure(code);
  return found;
}

Result<void> Database::run(const std::string& sql, std::span<const Value> values) {
  const auto done = rows(sql, values);
  if (!done) return tl::unexpected(done.error());
  return {};
}

Result<void> Database::atomically(const std::function<Result<void>()>& work) {
  if (auto begun = run("BEGIN IMMEDIATE"); !begun) return begun;
  // A failed COMMIT may have rolled back by itself already. Needs no memory of ours: there may be none.
  const auto rollBack = [this] {
    if (sqlite3_get_autocommit(handle_.get()) == 0)
      (void)sqlite3_exec(handle_.get(), "ROLLBACK", nullptr, nullptr, nullptr);
  };
  try {
    auto done = work();
    if (done) done = run("COMMIT");
    if (!done) rollBack();
    return done;
  } catch (...) {
    rollBack();
    throw;
  }
}

Result<void> Database::checkPages() {
  const auto said = rows("PRAGMA integrity_check(1)");
  if (!said) return tl::unexpected(said.error());
  const auto* text = said->empty() || said->front().empty() ? nullptr : std::get_if<std::string>(&said->front()[0]);
  if (text != nullptr && *text == "ok") return {};
  return fail(ErrorCode::kBadInput,
              "damaged (" + (text != nullptr ? *text : std::string("cannot be checked")) +
                  "); put a backup of the whole folder in its place, or move the folder away to start anew",
              file_.string());
}

Result<void> putRow(Database& database, const std::string& table, Row row) {
  row.emplace_back(digestOf(table, row));
  std::string places;
  for (std::size_t i = 0; i < row.size(); ++i) places += i == 0 ? "?" : ",?";
  return database.run("INSERT OR REPLACE INTO " + table + " VALUES(" + places + ")", row);
}

Result<std::vector<Row>> checkedRows(Database& database, const std::string& table, const std::string& order) {
  auto rows = database.rows("SELECT * FROM " + table + " " + order);
  if (!rows) return rows;
  for (auto& row : *rows) {
    const auto* digest = row.empty() ? nullptr : std::get_if<std::string>(&row.back());
    if (digest == nullptr || *digest != digestOf(table, std::span(row).first(row.size() - 1)))
      return fail(ErrorCode::kBadInput,
                  "damaged: a row of " + table +
                      " is not what was written; put a backup of the whole folder in its place, or move the folder "
                      "away to start anew",
                  database.file().string());
    row.pop_back();
  }
  return rows;
}

}  // namespace radiosity::state
