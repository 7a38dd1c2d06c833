#include "client/lib/http.h"

#include <array>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/buffer_body.hpp>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/file_body.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/http/write.hpp>

#include "client/lib/pump.h"
#include "client/lib/stream.h"

namespace radiosity::client {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
using detail::Pump;
using detail::transferError;

constexpr std::size_t kChunkBytes = 256U << 10U;
constexpr std::uint64_t kMaxDownloadBytes = 64ULL << 30U;  // a bound where there must be one; a scene is far smaller

/// One request and its answer over one connection.
class Exchange {
 public:
  explicit Exchange(const HttpOptions& options)
      : options_(options), pump_(options.keep_going), stream_(pump_.context()) {}

  Result<void> connect() {
    return detail::openStream(pump_, stream_, options_.url, options_.trust, options_.connect_timeout);
  }

  template <typename Body>
  http::request<Body> request(http::verb verb, std::string_view path) const {
    http::request<Body> out(verb, options_.url.target(path), 11);
    out.set(http::field::host, options_.url.authority());
    out.set(http::field::user_agent, "radiosity");
    out.set(http::field::connection, "close");
    if (!options_.token.empty()) out.set(http::field::authorization, "Bearer " + options_.token);
    return out;
  }

  /// A failed write is not yet a failed exchange: a server that refuses an upload answers and closes before its end.
  template <typename Body>
  beast::error_code send(http::request<Body>& message, std::uint64_t total_bytes) {
    http::request_serializer<Body> serializer(message);
    std::uint64_t done_bytes = 0;
    while (!serializer.is_done()) {
      std::size_t sent_bytes = 0;
      const auto error = pump_.await(stream_, options_.silence_timeout, [&](auto handler) {
        http::async_write_some(stream_, serializer, [&sent_bytes, handler](beast::error_code e, std::size_t n) mutable {
          sent_bytes = n;
          handler(e);
        });
      });
      if (error) return error;
      done_bytes += sent_bytes;
      report(std::min(done_bytes, total_bytes), total_bytes);
    }
    return {};
  }

  /// Reads the answer; a 2xx body goes to `file` where there is one.
  Result<HttpReply> receive(AtomicFile* file) {
    http::response_parser<http::buffer_body> parser;
    parser.body_limit(kMaxDownloadBytes);
    auto error = pump_.await(stream_, options_.silence_timeout,
                             [&](auto handler) { http::async_read_header(stream_, buffer_, parser, handler); });
    if (error) return tl::unexpected(transferError(error, options_.url, "waiting for the answer"));
    HttpReply reply;
    reply.status = parser.get().result_int();
    reply.content_type = std::string(parser.get()[http::field::content_type]);
    auto moved = readBody(parser, reply, reply.ok() ? file : nullptr);
    if (!moved) return tl::unexpected(moved.error());
    return reply;
  }

  [[nodiscard]] bool interrupted() const { return pump_.interrupted(); }

 private:
  Result<void> readBody(http::response_parser<http::buffer_body>& parser, HttpReply& reply, AtomicFile* file) {
    std::vector<std::uint8_t> chunk(kChunkBytes);
    const std::uint64_t total_bytes = parser.content_length().value_or(0);
    std::uint64_t done_bytes = 0;
    while (!parser.is_done()) {
      parser.get().body().data = chunk.data();
      parser.get().body().size = chunk.size();
      auto error = pump_.await(stream_, options_.silence_timeout,
                               [&](auto handler) { http::async_read(stream_, buffer_, parser, handler); });
      if (error == http::error::need_buffer) error = {};
      if (error) return tl::unexpected(transferError(error, options_.url, "downloading"));
      const std::size_t count = chunk.size() - parser.get().body().size;
      done_bytes += count;
      if (file != nullptr) {
        auto written = file->write(std::span(chunk.data(), count));
        if (!written) return written;
        report(done_bytes, total_bytes);
      } else if (done_bytes > kMaxReplyBytes) {
        return fail(ErrorCode::kTooLarge, "the server's answer is over 16 MiB", options_.url.text());
      } else {
        reply.body.append(reinterpret_cast<const char*>(chunk.data()), count);
      }
    }
    return {};
  }

  void report(std::uint64_t done_bytes, std::uint64_t total_bytes) const {
    if (options_.progress) options_.progress(done_bytes, total_bytes);
  }

  const HttpOptions& options_;
  Pump pump_;
  detail::Stream stream_;
  beast::flat_buffer buffer_;
};

Result<HttpReply> get(const HttpOptions& options, std::string_view path, AtomicFile* file) {
  Exchange exchange(options);
  if (auto connected = exchange.connect(); !connected) return tl::unexpected(connected.error());
  auto message = exchange.request<http::empty_body>(http::verb::get, path);
  if (const auto error = exchange.send(message, 0); error)
    return tl::unexpected(transferError(error, options.url, "sending the request"));
  return exchange.receive(file);
}

template <typename Body>
Result<HttpReply> put(const HttpOptions& options, std::string_view path, std::string_view content_type,
                      typename Body::value_type body, std::uint64_t size_bytes) {
  Exchange exchange(options);
  if (auto connected = exchange.connect(); !connected) return tl::unexpected(connected.error());
  auto message = exchange.template request<Body>(http::verb::put, path);
  message.set(http::field::content_type, content_type);
  message.body() = std::move(body);
  message.prepare_payload();
  const auto send_error = exchange.send(message, size_bytes);
  if (send_error && exchange.interrupted()) return tl::unexpected(transferError(send_error, options.url, "uploading"));
  auto reply = exchange.receive(nullptr);
  if (!reply && send_error) return tl::unexpected(transferError(send_error, options.url, "uploading"));
  return reply;
}

}  // namespace

Result<HttpReply> httpGet(const HttpOptions& options, std::string_view path) { return get(options, path, nullptr); }

Result<HttpReply> httpGetToFile(const HttpOptions& options, std::string_view path, AtomicFile& file) {
  return get(options, path, &file);
}

Result<HttpReply> httpPutFile(const HttpOptions& options, std::string_view path, std::string_view content_type,
                              const std::string& file) {
  beast::error_code error;
  http::file_body::value_type body;
  body.open(file.c_str(), beast::file_mode::scan, error);
  if (error) return fail(ErrorCode::kBadInput, "cannot be read: " + error.message(), file);
  const std::uint64_t size_bytes = body.size();
  return put<http::file_body>(options, path, content_type, std::move(body), size_bytes);
}

Result<HttpReply> httpPutText(const HttpOptions& options, std::string_view path, std::string_view content_type,
                              std::string body) {
  const std::uint64_t size_bytes = body.size();
  return put<http::string_body>(options, path, content_type, std::move(body), size_bytes);
}

}  // namespace radiosity::client
