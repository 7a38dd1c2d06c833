#include "client/cli/exit_code.h"

#include <cstdio>

#include "client/cli/interrupt.h"
#include "common/one_line.h"

namespace radiosity::cli {
namespace {

std::string complaint_place;

}  // namespace

ExitCode exitCodeOf(ErrorCode code) {
  switch (code) {
    case ErrorCode::kBadUsage:
    case ErrorCode::kBadInput:
    case ErrorCode::kInvalidScene:
    case ErrorCode::kUnsupported:
    case ErrorCode::kNotFound:
    case ErrorCode::kTooLarge:
    case ErrorCode::kStaleRevision:
    case ErrorCode::kTestFailed:
      return ExitCode::kBadInput;
    case ErrorCode::kBusy:
    case ErrorCode::kUnavailable:
    case ErrorCode::kInternal:
    case ErrorCode::kCancelled:
      break;
  }
  return ExitCode::kFailed;
}

ExitCode complain(const Error& error) {
  if (interrupted()) {
    std::fputs("radiosity: interrupted\n", stderr);
    return ExitCode::kInterrupted;
  }
  const auto text = complaint_place.empty() ? error.text() : complaint_place + ": " + error.text();
  std::fprintf(stderr, "radiosity: error: %s\n", oneLine(text).c_str());
  return exitCodeOf(error.code);
}

ExitCode complain(const client::CallFailure& failure) {
  Error error = failure.error;
  if (failure.rpc && failure.rpc->op) {
    const auto operation = "operation " + std::to_string(*failure.rpc->op);
    if (error.message.starts_with(operation + ": "))
      error.message.erase(0, operation.size() + 2);  // said once is enough
    error.where = operation + (error.where.empty() ? "" : ": " + error.where);
  }
  return complain(error);
}

void complainAt(std::string place) { complaint_place = std::move(place); }

void warn(const std::string& text) { std::fprintf(stderr, "radiosity: warning: %s\n", oneLine(text).c_str()); }

}  // namespace radiosity::cli
