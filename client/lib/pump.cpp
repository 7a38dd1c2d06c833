#include "client/lib/pump.h"

#include <boost/asio/connect.hpp>
#include <boost/beast/http/error.hpp>
#include <boost/beast/websocket/error.hpp>

namespace radiosity::client::detail {

namespace asio = boost::asio;
namespace beast = boost::beast;

Error transferError(const beast::error_code& error, const ServerUrl& url, const std::string& doing) {
  const std::string where = url.text();
  if (error == asio::error::interrupted) return {ErrorCode::kUnavailable, doing + ": interrupted", where};
  if (error == beast::error::timeout)
    return {ErrorCode::kUnavailable, doing + ": the server did not answer in time", where};
  if (error == asio::error::connection_refused)
    return {ErrorCode::kUnavailable, doing + ": connection refused; is a radiosityd running there?", where};
  if (error == asio::error::host_not_found || error == asio::error::host_not_found_try_again)
    return {ErrorCode::kUnavailable, doing + ": no such host: " + url.host, where};
  if (error == asio::error::eof || error == beast::http::error::end_of_stream ||
      error == beast::http::error::partial_message || error == asio::error::connection_reset ||
      error == asio::error::broken_pipe || error == beast::websocket::error::closed)
    return {ErrorCode::kUnavailable, doing + ": the server closed the connection", where};
  return {ErrorCode::kUnavailable, doing + ": " + error.message(), where};
}

Result<void> connectTo(Pump& pump, beast::tcp_stream& stream, const ServerUrl& url, Clock::duration timeout) {
  asio::ip::tcp::resolver resolver(pump.context());
  beast::error_code error;
  // Numeric addresses skip the resolver, whose thread cannot be interrupted.
  std::vector<asio::ip::tcp::endpoint> endpoints;
  if (const auto address = asio::ip::make_address(url.host, error); !error) {
    endpoints.emplace_back(address, url.port);
  } else {
    const auto found = resolver.resolve(url.host, std::to_string(url.port), error);
    if (error) return tl::unexpected(transferError(error, url, "connecting"));
    for (const auto& entry : found) endpoints.push_back(entry.endpoint());
  }
  for (const auto& endpoint : endpoints) {
    error = pump.await(stream, timeout, [&](auto handler) { stream.async_connect(endpoint, handler); });
    if (!error || pump.interrupted()) break;
  }
  if (error) return tl::unexpected(transferError(error, url, "connecting"));
  stream.socket().set_option(asio::ip::tcp::no_delay(true), error);
  return {};
}

}  // namespace radiosity::client::detail
