// The HTTP routes: which paths there are, what may be done to them, and what comes back. Knows no sockets. Any thread.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "server/net/http_message.h"
#include "server/net/hub.h"

namespace radiosity::net {

/// Called once, from any thread. Must not own a session: the engine may keep it longer than the server lives.
using Respond = std::function<void(HttpResponse)>;

/// Looks at a request before its body is read: 404, 405 with Allow, or 415; nothing when it may go on.
[[nodiscard]] std::optional<HttpResponse> refusal(const HttpRequest& request);

/// Whether the token is needed: everywhere but for the probes and the viewer's own files.
[[nodiscard]] bool needsToken(const HttpRequest& request);

/// Whether request.body_sha256 is to be filled in: the answer names the body by it.
[[nodiscard]] bool namedByContent(const HttpRequest& request);

/// Answers a request for which refusal() found nothing.
void respond(const std::shared_ptr<Hub>& hub, HttpRequest request, const Respond& done);

}  // namespace radiosity::net
