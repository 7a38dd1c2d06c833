// SQLite behind Result<T>: one connection, write-ahead log, every commit on the disk before it returns. One thread at a
// time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "common/result.h"
#include "server/state/known_files.h"

struct sqlite3;

namespace radiosity::state {

using Value = std::variant<std::int64_t, double, std::string>;
using Row = std::vector<Value>;

class Database {
 public:
  /// Opens or makes the file. Errors name it: kUnavailable (disk full, not writable, in use), kBadInput (damaged, or no
  /// database).
  [[nodiscard]] static Result<Database> open(const std::filesystem::path& file);

  [[nodiscard]] Result<void> run(const std::string& sql, std::span<const Value> values = {});
  [[nodiscard]] Result<std::vector<Row>> rows(const std::string& sql, std::span<const Value> values = {});

  /// All of `work` or nothing: on the disk when this returns without an error.
  [[nodiscard]] Result<void> atomically(const std::function<Result<void>()>& work);

  /// Reads every page: kBadInput says what is wrong.
  [[nodiscard]] Result<void> checkPages();

  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  /// Of the open file; kUnavailable where it was removed or replaced since, as far as SQLite can tell.
  [[nodiscard]] Result<FileIdentity> identity() const;
  /// Closing leaves the write-ahead log as it is. Else SQLite removes the file of that name, which may be the log of
  /// another database by then.
  void keepLog();

 private:
  struct Close {
    void operator()(sqlite3* handle) const;
  };
  explicit Database(std::filesystem::path file) : file_(std::move(file)) {}
  /// What the connection says of its last failure.
  [[nodiscard]] tl::unexpected<Error> failure(int code) const;

  std::filesystem::path file_;
  std::unique_ptr<sqlite3, Close> handle_;
};

/// Rows that carry a digest of themselves, which tells a flipped bit that SQLite cannot see. The last column of the
/// table must be `digest TEXT`.
[[nodiscard]] Result<void> putRow(Database& database, const std::string& table, Row row);
/// All rows, each checked and without its digest; `order`: "ORDER BY ..." or "". kBadInput names file and table.
[[nodiscard]] Result<std::vector<Row>> checkedRows(Database& database, const std::string& table,
                                                   const std::string& order);

}  // namespace radiosity::state
