#include "server/scene/document/document_uri.h"

#include <algorithm>
#include <fstream>
#include <optional>
#include <system_error>

#include "common/task.h"

namespace radiosity::scene {
namespace {

std::optional<int> hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return std::nullopt;
}

std::optional<std::string> percentDecode(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      out += text[i];
      continue;
    }
    if (text.size() - i < 3) return std::nullopt;
    const auto high = hexDigit(text[i + 1]);
    const auto low = hexDigit(text[i + 2]);
    if (!high || !low) return std::nullopt;
    out += static_cast<char>(*high * 16 + *low);
    i += 2;
  }
  return out;
}

std::optional<int> base64Digit(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+' || c == '-') return 62;
  if (c == '/' || c == '_') return 63;
  return std::nullopt;
}

std::optional<Bytes> base64Decode(std::string_view text) {
  for (int i = 0; i < 2 && !text.empty() && text.back() == '='; ++i) text.remove_suffix(1);
  if (text.size() % 4 == 1) return std::nullopt;
  Bytes out;
  out.reserve(text.size() / 4 * 3 + 3);
  std::uint32_t group = 0;
  int bits = 0;
  for (const char c : text) {
    interruptionPoint();
    const auto digit = base64Digit(c);
    if (!digit) return std::nullopt;
    group = group << 6 | static_cast<std::uint32_t>(*digit);
    bits += 6;
    if (bits >= 8) {
      bits -= 8;
      out.push_back(static_cast<std::uint8_t>(group >> bits));
      group &= (1U << bits) - 1;
    }
  }
  return out;
}

bool isWithin(const std::filesystem::path& file, const std::filesystem::path& folder) {
  const auto [end, rest] = std::mismatch(folder.begin(), folder.end(), file.begin(), file.end());
  return end == folder.end() && rest != file.end();
}

}  // namespace

bool isDataUri(std::string_view uri) { return uri.rfind("data:", 0) == 0; }

Result<Bytes> decodeDataUri(std::string_view uri, const std::string& where) {
  const auto comma = uri.find(',');
  if (comma == std::string_view::npos) return fail(ErrorCode::kBadInput, "data URI has no comma", where);
  const auto header = uri.substr(0, comma);
  const auto payload = uri.substr(comma + 1);
  constexpr std::string_view kBase64 = ";base64";
  if (header.size() >= kBase64.size() && header.substr(header.size() - kBase64.size()) == kBase64) {
    auto bytes = base64Decode(payload);
    if (!bytes) return fail(ErrorCode::kBadInput, "data URI is not valid base64", where);
    return std::move(*bytes);
  }
  const auto text = percentDecode(payload);
  if (!text) return fail(ErrorCode::kBadInput, "data URI has a malformed % escape", where);
  return Bytes(text->begin(), text->end());
}

Result<std::filesystem::path> resolveUri(std::string_view uri, const std::filesystem::path& folder,
                                         const std::string& where) {
  const auto refuse = [&](const std::string& why) {
    const std::string shown(uri.substr(0, 120));
    return fail(ErrorCode::kBadInput, "URI '" + shown + "' " + why + "; put the file beside the scene", where);
  };
  const auto decoded = percentDecode(uri);
  if (!decoded || decoded->empty()) return refuse("is empty or has a malformed % escape");
  if (std::any_of(decoded->begin(), decoded->end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; })) {
    return refuse("has control characters");
  }
  if (uri.substr(0, uri.find('/')).find(':') != std::string_view::npos) return refuse("has a scheme");
  if (decoded->find('\\') != std::string::npos) return refuse("has a backslash");
  const std::filesystem::path relative(*decoded);
  if (relative.is_absolute()) return refuse("is absolute");
  if (std::find(relative.begin(), relative.end(), "..") != relative.end()) return refuse("leads out of the folder");
  std::error_code error;
  const auto home = std::filesystem::canonical(folder.empty() ? "." : folder, error);
  const auto file = error ? home : std::filesystem::canonical(home / relative, error);
  if (error) return fail(ErrorCode::kNotFound, "file '" + *decoded + "' cannot be opened: " + error.message(), where);
  if (!isWithin(file, home)) return refuse("is a link out of the folder");
  return file;
}

Result<Bytes> readFile(const std::filesystem::path& file, std::size_t max_bytes, const std::string& where) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    const auto why = error ? error.message() : std::string("not a regular file");
    return fail(ErrorCode::kNotFound, "cannot be opened: " + why, where);
  }
  const auto size = std::filesystem::file_size(file, error);
  if (error) return fail(ErrorCode::kNotFound, "cannot be opened: " + error.message(), where);
  if (size > max_bytes) {
    return fail(ErrorCode::kTooLarge,
                "has " + std::to_string(size) + " bytes; the limit is " + std::to_string(max_bytes), where);
  }
  std::ifstream in(file, std::ios::binary);
  Bytes bytes(size);
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!in) return fail(ErrorCode::kNotFound, "cannot be read", where);
  return bytes;
}

}  // namespace radiosity::scene
