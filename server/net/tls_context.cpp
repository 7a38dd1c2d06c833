#include "server/net/tls_context.h"

#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <openssl/x509err.h>
#include <ctime>
#include <fstream>
#include <string>

#include "common/log.h"

namespace radiosity::net {
namespace {

namespace ssl = boost::asio::ssl;
using BoostError = boost::system::error_code;

tl::unexpected<Error> bad(const std::string& why, const char* option, const std::filesystem::path& file) {
  ERR_clear_error();
  return fail(ErrorCode::kBadUsage, why, std::string(option) + " " + file.string());
}

/// OpenSSL says of a file that it cannot open no more than "system lib".
Result<void> checkReadable(const std::filesystem::path& file, const char* option) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream || stream.peek() == std::ifstream::traits_type::eof())
    return bad("cannot be read, or is empty", option, file);
  return {};
}

Result<void> useCertificate(ssl::context& context, const std::filesystem::path& file) {
  if (auto readable = checkReadable(file, "--tls-cert"); !readable) return readable;
  BoostError error;
  context.use_certificate_chain_file(file.string(), error);
  if (error) return bad("is not a PEM certificate (" + error.message() + ")", "--tls-cert", file);
  return {};
}

Result<void> useKey(ssl::context& context, const std::filesystem::path& file) {
  if (auto readable = checkReadable(file, "--tls-key"); !readable) return readable;
  bool encrypted = false;
  BoostError error;
  // Without this OpenSSL would ask for the password at the terminal.
  context.set_password_callback(
      [&encrypted](std::size_t, ssl::context::password_purpose) {
        encrypted = true;
        return std::string();
      },
      error);
  if (!error) context.use_private_key_file(file.string(), ssl::context::pem, error);
  BoostError ignored;
  context.set_password_callback([](std::size_t, ssl::context::password_purpose) { return std::string(); }, ignored);
  if (encrypted)
    return bad(
        "the key is encrypted, and a service has nobody to ask for the password; decrypt it: openssl pkey -in "
        "KEY -out NEW_KEY",
        "--tls-key", file);
  if (!error) return {};
  if (ERR_GET_REASON(static_cast<unsigned long>(error.value())) == X509_R_KEY_VALUES_MISMATCH)
    return bad("is not the key of the certificate given with --tls-cert", "--tls-key", file);
  return bad("is not a PEM private key (" + error.message() + ")", "--tls-key", file);
}

std::int64_t endOf(const X509& certificate) {
  std::tm parts{};
  if (ASN1_TIME_to_tm(X509_get0_notAfter(&certificate), &parts) != 1) return 0;
  return static_cast<std::int64_t>(timegm(&parts));
}

}  // namespace

Result<std::shared_ptr<TlsContext>> loadTls(const std::filesystem::path& certificate,
                                            const std::filesystem::path& key) {
  auto tls = std::make_shared<TlsContext>();
  auto& context = tls->context;
  auto* native = context.native_handle();
  SSL_CTX_set_min_proto_version(native, TLS1_2_VERSION);
  // Renegotiation is of no use here and lets a peer make the server work for nothing; neither is compression.
  SSL_CTX_set_options(native, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION | SSL_OP_CIPHER_SERVER_PREFERENCE);
  // Who comes again brings a ticket. What is kept of those who do not (20,480 of them) would only take memory.
  SSL_CTX_set_session_cache_mode(native, SSL_SESS_CACHE_OFF);
  if (auto used = useCertificate(context, certificate); !used) return tl::unexpected(std::move(used.error()));
  if (auto used = useKey(context, key); !used) return tl::unexpected(std::move(used.error()));
  if (SSL_CTX_check_private_key(native) != 1)
    return bad("is not the key of the certificate given with --tls-cert", "--tls-key", key);
  tls->expires_at_s = endOf(*SSL_CTX_get0_certificate(native));
  if (tls->expires_at_s < static_cast<std::int64_t>(std::time(nullptr)))
    log::warn("--tls-cert {}: the certificate has expired; clients will refuse it", certificate.string());
  return tls;
}

}  // namespace radiosity::net
