// Names of Boost.Beast and Asio for the few .cpp files that speak to sockets. Nothing else includes this: it is slow to
// compile.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/strand.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/vector_body.hpp>
#include <cstdint>

namespace radiosity::net {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using tcp = boost::asio::ip::tcp;
using BoostError = boost::system::error_code;

/// Every socket has its own strand, so a session's handlers never run side by side.
using Strand = asio::strand<asio::io_context::executor_type>;
using TcpStream = beast::basic_stream<tcp, Strand>;
using Upgrade = http::request<http::vector_body<std::uint8_t>>;

}  // namespace radiosity::net
