// Scripts for `radiosity script`: one command a line, without `radiosity` and URL, and loops. Pure but for the text.
//
//   # a comment
//   for s from 5 to 100 count 20 index i      # s = 5, 10, ... 100; i = 00, 01, ... 19
//     set @lamp.emissiveStrength $s
//     wait --error 0.02
//     snapshot -o lamp-$i.png
//   end
//   for color in 1,0,0 0,1,0 0,0,1
//     set @wall.color $color
//   end
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/result.h"

namespace radiosity::cli {

/// A line as words, before variables are put in.
struct ScriptLine {
  int number = 0;  ///< from 1
  std::vector<std::string> words;
};

/// One command to run.
struct ScriptStep {
  int line = 0;
  std::vector<std::string> words;
};

class Script {
 public:
  /// Errors are kBadInput, `where` is "FILE:LINE". At most 1 MiB, 16 loops inside each other.
  [[nodiscard]] static Result<Script> parse(const std::string& text, std::string name);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::string place(int line) const { return name_ + ":" + std::to_string(line); }

  /// Calls `visit` with each command in order, as often as its loops say; false ends it. `first_only`: each loop once,
  /// to check a script before anything is done. The error is that of a variable nobody set.
  [[nodiscard]] Result<void> run(bool first_only, const std::function<bool(const ScriptStep&)>& visit) const;

 private:
  Result<void> checkLoops() const;

  std::string name_;
  std::vector<ScriptLine> lines_;
};

}  // namespace radiosity::cli
