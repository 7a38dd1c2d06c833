// HTTP over real sockets against the fake engine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>

#include <array>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "protocol/http_bodies.h"
#include "server/net/access.h"
#include "server/net/http_message.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

net::ServerOptions withToken() {
  net::ServerOptions options;
  options.token = kSecret;
  return options;
}

TEST(Http, EveryRouteAnswersWithItsType) {
  RunningServer server;
  server.engine.publish();
  const struct {
    const char* target;
    const char* type;
    const char* content;
  } routes[] = {{"/", "text/html", "radiosityd"},
                {"/status", "text/html", "Scene revision"},
                {"/scene.gltf", "model/gltf+json", "asset"},
                {"/scene.glb", "model/gltf-binary", "glTF scene"},
                {"/scene-unlit.glb?x=1", "model/gltf-binary", "glTF unlit"},
                {"/lightmaps/0.exr", "image/x-exr", "exr"},
                {"/snapshot.png?camera=my%20desk&width=320&height=200&quantity=normal&exposure=4e3", "image/png",
                 "png 320x200 normal my desk 4000"},
                {"/healthz", "text/plain", "ok"},
                {"/readyz", "text/plain", "ready"},
                {"/metrics", "text/plain; version=0.0.4", "radiosityd_scene_revision"}};
  for (const auto& route : routes) {
    SCOPED_TRACE(route.target);
    const auto got = request(server.port(), "GET", route.target);
    EXPECT_EQ(got.status, 200) << got.body;
    EXPECT_THAT(got.header("Content-Type"), HasSubstr(route.type));
    EXPECT_THAT(got.body, HasSubstr(route.content));
    const auto head = request(server.port(), "HEAD", route.target);
    EXPECT_EQ(head.status, 200);
    EXPECT_FALSE(head.header("Content-Length").empty());
  }
}

TEST(Http, TheDocumentSaysItsRevision) {
  RunningServer server;
  EXPECT_EQ(request(server.port(), "GET", "/scene.gltf").header("X-Revision"), "0");
  EXPECT_EQ(request(server.port(), "PUT", "/scene", {}, "scene").status, 200);
  EXPECT_EQ(request(server.port(), "GET", "/scene.gltf").header("X-Revision"), "1");
}

TEST(Http, TheGeometryOfAnotherLayoutIsNotGiven) {
  RunningServer server;
  server.engine.publish();
  const auto layout = server.engine.lightmaps()->layout;
  const auto ask = [&](const std::string& which) {
    return request(server.port(), "GET", "/scene.glb?layout=" + which);
  };
  EXPECT_EQ(ask(std::to_string(layout)).body, "glTF scene");
  for (const auto other : {layout - 1, layout + 1}) {
    const auto refused = ask(std::to_string(other));
    EXPECT_EQ(refused.status, 204);
    EXPECT_EQ(refused.body, "");
  }
  for (const auto* wrong : {"", "x", "1x", "-1", "18446744073709551616"}) {
    const auto bad = ask(wrong);
    EXPECT_EQ(bad.status, 400) << wrong;
    EXPECT_EQ(protocol::decodeHttpError(400, bad.body).where, "?layout=") << wrong;
  }
  server.engine.changeLayout({});
  EXPECT_EQ(ask(std::to_string(layout)).status, 204);
  EXPECT_EQ(ask(std::to_string(layout + 1)).status, 200);
}

TEST(Http, WhatIsNotThereIsSaidSoInJson) {
  RunningServer server;
  const auto missing = request(server.port(), "GET", "/nothing");
  EXPECT_EQ(missing.status, 404);
  EXPECT_EQ(protocol::decodeHttpError(404, missing.body).code, ErrorCode::kNotFound);
  EXPECT_EQ(request(server.port(), "GET", "/lightmaps/7.exr").status, 404);
  EXPECT_EQ(request(server.port(), "GET", "/lightmaps/x").status, 404);
  EXPECT_EQ(request(server.port(), "GET", "/snapshots/unknown.png").status, 404);
  EXPECT_EQ(request(server.port(), "GET", "/snapshot.png?camera=nobody").status, 404);
  const auto bad = request(server.port(), "GET", "/snapshot.png?width=0");
  EXPECT_EQ(bad.status, 400);
  EXPECT_EQ(protocol::decodeHttpError(400, bad.body).where, "?width=");
  for (const auto* exposure : {"0", "-1", "nan", "1e31", "1x", ""}) {
    const auto wrong = request(server.port(), "GET", std::string("/snapshot.png?exposure=") + exposure);
    EXPECT_EQ(wrong.status, 400) << exposure;
    EXPECT_EQ(protocol::decodeHttpError(400, wrong.body).where, "?exposure=") << exposure;
  }
}

TEST(Http, EveryErrorHasItsStatus) {
  const std::pair<ErrorCode, int> statuses[] = {
      {ErrorCode::kBadUsage, 400},      {ErrorCode::kBadInput, 400},   {ErrorCode::kInvalidScene, 400},
      {ErrorCode::kUnsupported, 400},   {ErrorCode::kNotFound, 404},   {ErrorCode::kTooLarge, 413},
      {ErrorCode::kStaleRevision, 409}, {ErrorCode::kTestFailed, 409}, {ErrorCode::kBusy, 503},
      {ErrorCode::kUnavailable, 503},   {ErrorCode::kCancelled, 409},  {ErrorCode::kInternal, 500}};
  for (const auto& [code, status] : statuses) {
    const auto response = net::errorResponse({code, "what was wrong", "where"});
    EXPECT_EQ(response.status, status);
    const auto read = protocol::decodeHttpError(status, response.text);
    EXPECT_EQ(read.code, code);
    EXPECT_EQ(read.where, "where");
    EXPECT_EQ(response.headers.empty(), status != 503) << "Retry-After";
  }
}

TEST(Http, AnUploadSaysWhereItIs) {
  RunningServer server;
  const auto got = request(server.port(), "PUT", "/uploads", {}, "12345");
  EXPECT_EQ(got.header("Location"), *protocol::decodeHttpUrl(got.body));
}

TEST(Http, AMethodThatIsNotAllowedNamesThoseThatAre) {
  RunningServer server;
  const auto got = request(server.port(), "POST", "/scene", {}, "x");
  EXPECT_EQ(got.status, 405);
  EXPECT_EQ(got.header("Allow"), "PUT, OPTIONS");
  EXPECT_EQ(request(server.port(), "DELETE", "/scene.glb").header("Allow"), "GET, HEAD, OPTIONS");
  EXPECT_EQ(request(server.port(), "OPTIONS", "/scene.glb").status, 204);
  EXPECT_EQ(request(server.port(), "GET", "/ws").status, 426);
}

TEST(Http, PutSceneLoadsAndReportsWarnings) {
  RunningServer server;
  const std::string body(300'000, 'g');
  const auto got = request(server.port(), "PUT", "/scene?name=room.glb", "Content-Type: model/gltf-binary\r\n", body);
  ASSERT_EQ(got.status, 200) << got.body;
  const auto reply = protocol::decodeHttpLoad(got.body);
  ASSERT_TRUE(reply.has_value());
  EXPECT_EQ(reply->revision, 1U);
  EXPECT_EQ(reply->warnings.size(), 1U);
  EXPECT_EQ(server.engine.lastLoad(), "room.glb: 300000 bytes by ");
}

TEST(Http, WhoLoadsASceneIsNamedOrElseByTheProgram) {
  RunningServer server;
  const auto loadedBy = [&](const std::string& target, const std::string& headers) {
    EXPECT_EQ(request(server.port(), "PUT", target, headers, "12345").status, 200);
    return server.engine.lastLoad();
  };
  const std::string curl = "User-Agent: curl/7.88.1 (x86_64)\r\n";
  EXPECT_EQ(loadedBy("/scene", curl), "unnamed scene: 5 bytes by curl/7.88.1");
  EXPECT_EQ(loadedBy("/scene", curl + "X-Client: Ann\r\n"), "unnamed scene: 5 bytes by Ann");
  EXPECT_EQ(loadedBy("/scene?client=Ben%20Bo", curl + "X-Client: Ann\r\n"), "unnamed scene: 5 bytes by Ben Bo");
  EXPECT_EQ(loadedBy("/scene?client=" + std::string(1000, 'x'), {}),
            "unnamed scene: 5 bytes by " + std::string(256, 'x'));
  EXPECT_EQ(loadedBy("/scene?client=", curl + "X-Client: Ann\r\n"), "unnamed scene: 5 bytes by Ann");
  EXPECT_EQ(loadedBy("/scene?client=%ff%fe%0a%0dAnn%c3%a9", {}), "unnamed scene: 5 bytes by ??  Ann\xc3\xa9");
  EXPECT_EQ(loadedBy("/scene?client=" + std::string(255, 'x') + "%c3%a9", {}),
            "unnamed scene: 5 bytes by " + std::string(255, 'x'))
      << "no half of a character";
}

TEST(Http, ASceneThatIsRefusedSaysWhere) {
  RunningServer server;
  const auto got = request(server.port(), "PUT", "/scene", "X-Name: room.glb\r\n", "bad scene");
  EXPECT_EQ(got.status, 400);
  const auto error = protocol::decodeHttpError(400, got.body);
  EXPECT_EQ(error.code, ErrorCode::kInvalidScene);
  EXPECT_EQ(error.where, "room.glb: /accessors/4/count");
}

TEST(Http, AWrongContentTypeIsRefused) {
  RunningServer server;
  const auto got =
      request(server.port(), "PUT", "/scene", "Content-Type: application/x-www-form-urlencoded\r\n", "abc");
  EXPECT_EQ(got.status, 415);
}

TEST(Http, ABodyOverTheLimitIsRefusedBeforeItIsSent) {
  net::ServerOptions options;
  options.max_upload_bytes = 1000;
  RunningServer server(options);
  RawHttp announced(server.port());
  announced.send("PUT /scene HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1001\r\n\r\n");
  EXPECT_EQ(announced.receive().status, 413);
  RawHttp chunked(server.port());
  chunked.send("PUT /scene HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n");
  for (int i = 0; i < 4; ++i) chunked.send("190\r\n" + std::string(400, 'x') + "\r\n");
  EXPECT_EQ(chunked.receive().status, 413);
  EXPECT_EQ(request(server.port(), "PUT", "/scene", {}, std::string(1000, 'x')).status, 200);
}

TEST(Http, ExpectContinueIsAnsweredOnceTheRequestIsWelcome) {
  RunningServer server;
  RawHttp http(server.port());
  http.send("PUT /scene HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\nExpect: 100-continue\r\n\r\n");
  EXPECT_EQ(http.receive().status, 100);
  http.send("scene");
  EXPECT_EQ(http.receive().status, 200);
  RawHttp refused(server.port());
  refused.send("POST /scene HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\nExpect: 100-continue\r\n\r\n");
  EXPECT_EQ(refused.receive().status, 405);
}

TEST(Http, AConnectionServesManyRequestsAlsoPipelined) {
  RunningServer server;
  RawHttp http(server.port());
  const std::string get = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
  http.send(get);
  EXPECT_EQ(http.receive().status, 200);
  http.send(get + "GET /nothing HTTP/1.1\r\nHost: localhost\r\n\r\n" + get);
  EXPECT_EQ(http.receive().status, 200);
  EXPECT_EQ(http.receive().status, 404);
  EXPECT_EQ(http.receive().body, "ok\n");
  http.send("GET /healthz HTTP/1.0\r\n\r\n");
  EXPECT_EQ(http.receive().status, 200);
  EXPECT_TRUE(http.closed(Seconds(10)));
}

TEST(Http, WhatIsNotHttpIsAnsweredAndClosed) {
  RunningServer server;
  for (const std::string& text : {std::string("\x16\x03\x01\x02\x00\x01\r\n\r\n", 10), std::string("GET\r\n\r\n"),
                                  std::string("GET /healthz HTTP/1.1\r\nConnection: close\r\n\r\n"),
                                  std::string("GET /healthz HTTP/1.1\r\nHost: localhost\r\nHost: rebound.example\r\n"
                                              "Connection: close\r\n\r\n"),
                                  std::string("GET /%zz HTTP/1.1\r\nHost: localhost\r\n\r\n"),
                                  "GET /" + std::string(20'000, 'a') + " HTTP/1.1\r\nHost: localhost\r\n\r\n"}) {
    RawHttp http(server.port());
    http.send(text);
    const auto got = http.receive();
    EXPECT_TRUE(got.status == 400 || got.status == 431) << got.status;
    EXPECT_TRUE(http.closed(Seconds(10)));
  }
  EXPECT_EQ(request(server.port(), "GET", "/healthz").status, 200);
}

TEST(Http, AHeaderThatDripsInIsCutOff) {
  net::ServerOptions options;
  options.header_timeout = milliseconds(200);
  RunningServer server(options);
  RawHttp http(server.port());
  http.send("GET / HTTP/1.1\r\n");
  EXPECT_TRUE(http.closed(Seconds(20)));
}

TEST(Http, TheTokenGuardsAllButTheProbesAndTheViewer) {
  RunningServer server(withToken());
  for (const auto* target : {"/status", "/scene.glb", "/metrics", "/nothing"})
    EXPECT_EQ(request(server.port(), "GET", target).status, 401) << target;
  EXPECT_EQ(request(server.port(), "PUT", "/scene", {}, "x").status, 401);
  EXPECT_THAT(request(server.port(), "GET", "/status").header("WWW-Authenticate"), HasSubstr("Bearer"));
  EXPECT_EQ(request(server.port(), "GET", "/metrics", "Authorization: Bearer wrong\r\n").status, 401);
  EXPECT_EQ(request(server.port(), "GET", "/healthz").status, 200);
  EXPECT_EQ(request(server.port(), "GET", "/readyz").status, 200);
  EXPECT_EQ(request(server.port(), "GET", "/").status, 200);  // the page asks for the token
  EXPECT_EQ(request(server.port(), "GET", "/assets/none.js").status, 404);
  const auto good = std::string("Authorization: Bearer ") + kSecret + "\r\n";
  EXPECT_EQ(request(server.port(), "GET", "/metrics", good).status, 200);
}

TEST(Http, ABodyThatIsOfNoUseIsNotTaken) {
  RunningServer server(withToken());
  for (const auto* target : {"/healthz", "/", "/readyz"}) {
    RawHttp http(server.port());
    http.send(std::string("GET ") + target + " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000000\r\n\r\n");
    EXPECT_EQ(http.receive().status, 413) << target;
    EXPECT_TRUE(http.closed(Seconds(10)));
  }
  RawHttp chunked(server.port());
  chunked.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n");
  for (int i = 0; i < 5; ++i) chunked.send("4000\r\n" + std::string(0x4000, 'x') + "\r\n");
  EXPECT_EQ(chunked.receive().status, 413);
  EXPECT_EQ(request(server.port(), "GET", "/healthz", {}, "a body, though a small one").status, 200);
}

TEST(Http, TheViewerIsSentOnceAndPackedToThoseWhoTakeIt) {
  RunningServer server;
  const auto plain = request(server.port(), "GET", "/");
  EXPECT_THAT(plain.header("Content-Security-Policy"), HasSubstr("default-src 'none'"));
  EXPECT_EQ(plain.header("X-Content-Type-Options"), "nosniff");
  EXPECT_EQ(plain.header("Cache-Control"), "no-cache");
  EXPECT_EQ(plain.header("Content-Encoding"), "");
  const auto tag = plain.header("ETag");
  ASSERT_FALSE(tag.empty());

  for (const auto& matching : {tag, "\"other\", W/" + tag, std::string("*")}) {
    const auto again = request(server.port(), "GET", "/", "If-None-Match: " + matching + "\r\n");
    EXPECT_EQ(again.status, 304) << matching;
    EXPECT_EQ(again.body, "");
    EXPECT_EQ(again.header("ETag"), tag);
  }
  EXPECT_EQ(request(server.port(), "GET", "/", "If-None-Match: \"other\"\r\n").status, 200);

  for (const auto* refusing : {"", "Accept-Encoding: br\r\n", "Accept-Encoding: gzip;q=0\r\n"})
    EXPECT_EQ(request(server.port(), "GET", "/", refusing).body, plain.body) << refusing;
  const auto packed = request(server.port(), "GET", "/", "Accept-Encoding: br, gzip\r\n");
  if (packed.header("Content-Encoding") == "gzip") {  // not where the viewer was not built
    EXPECT_EQ(packed.body.substr(0, 2), "\x1f\x8b");
    EXPECT_EQ(packed.header("Vary"), "Accept-Encoding");
  }
  EXPECT_EQ(request(server.port(), "GET", "/assets/../index.html").status, 404);
}

TEST(Http, APageOfAnotherSiteMayNotSendScenes) {
  net::ServerOptions options;
  options.allow_origins = {"https://viewer.example.org"};
  RunningServer server(options);
  EXPECT_EQ(request(server.port(), "PUT", "/scene", "Origin: https://elsewhere.example\r\n", "x").status, 403);
  const auto allowed = request(server.port(), "PUT", "/scene", "Origin: https://viewer.example.org\r\n", "x");
  EXPECT_EQ(allowed.status, 200);
  EXPECT_EQ(allowed.header("Access-Control-Allow-Origin"), "https://viewer.example.org");
  const auto asked = request(server.port(), "OPTIONS", "/scene", "Origin: https://viewer.example.org\r\n");
  EXPECT_EQ(asked.status, 204);
  EXPECT_THAT(asked.header("Access-Control-Allow-Methods"), HasSubstr("PUT"));
  EXPECT_THAT(asked.header("Access-Control-Allow-Headers"), HasSubstr("Authorization"));
  EXPECT_THAT(asked.header("Access-Control-Expose-Headers"), HasSubstr("X-Revision"));
  EXPECT_EQ(request(server.port(), "GET", "/healthz").header("Access-Control-Allow-Origin"), "");
}

TEST(Http, ANameThatWasMadeToPointHereIsNotServed) {
  RunningServer server;
  RawHttp http(server.port());
  http.send("GET /scene.glb HTTP/1.1\r\nHost: rebound.example:80\r\n\r\n");
  EXPECT_EQ(http.receive().status, 403);
}

TEST(Http, ReadinessFollowsTheEngine) {
  RunningServer server;
  server.engine.progress(1.0, engine::SolveState::kLoading);
  EXPECT_EQ(request(server.port(), "GET", "/readyz").status, 503);
  EXPECT_EQ(request(server.port(), "GET", "/healthz").status, 200);
  server.engine.progress(1.0);
  EXPECT_EQ(request(server.port(), "GET", "/readyz").status, 200);
}

TEST(Http, TooManyConnectionsAreTurnedAway) {
  net::ServerOptions options;
  options.max_clients = 2;
  RunningServer server(options);
  RawHttp one(server.port());
  RawHttp two(server.port());
  const std::string get = "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n";
  one.send(get);
  two.send(get);
  EXPECT_EQ(one.receive().status, 200);
  EXPECT_EQ(two.receive().status, 200);
  RawHttp three(server.port());
  const auto refused = three.receive();
  EXPECT_EQ(refused.status, 503);
  EXPECT_FALSE(refused.header("Retry-After").empty());
}

TEST(Http, MetricsAreWellFormed) {
  RunningServer server;
  const auto text = request(server.port(), "GET", "/metrics").body;
  EXPECT_THAT(text, HasSubstr("radiosityd_solve_state{state=\"empty\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("radiosityd_solver_skipped_shots 7\n"));
  EXPECT_THAT(text, HasSubstr("# TYPE radiosityd_tiles_sent_total counter\n"));
  EXPECT_EQ(text.back(), '\n');
}

TEST(Http, AnEngineThatAnswersAfterTheServerIsGoneHarmsNobody) {
  mallopt(M_PERTURB, 0xa5);  // what is freed is written over, so that its use shows
  FakeEngine engine;
  engine.holdAnswers();
  std::vector<std::unique_ptr<RawHttp>> asking;
  {
    net::ServerOptions options;
    options.port = 0;
    options.drain_grace = milliseconds(50);
    auto server = net::Server::open(options, engine);
    ASSERT_TRUE(server.has_value());
    std::thread thread([&] { (*server)->run(); });
    for (int i = 0; i < 100; ++i) {
      asking.push_back(std::make_unique<RawHttp>((*server)->port()));
      asking.back()->send("GET /scene.glb HTTP/1.1\r\nHost: localhost\r\n\r\nGET /healthz HTTP/1.1\r\n");
    }
    RawHttp probe((*server)->port());
    probe.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
    EXPECT_EQ(probe.receive().status, 200);
    (*server)->drain();
    thread.join();
  }
  engine.release();
  engine.progress(0.5);
  engine.publish();
  mallopt(M_PERTURB, 0);
}

// ---- opening ----

TEST(Opening, APortInUseIsOneClearError) {
  RunningServer server;
  FakeEngine engine;
  net::ServerOptions options;
  options.port = server.port();
  const auto second = net::Server::open(options, engine);
  ASSERT_FALSE(second.has_value());
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().text(), HasSubstr(std::to_string(server.port())));
}

TEST(Opening, AnAddressBeyondThisMachineNeedsATokenOrInsecure) {
  FakeEngine engine;
  net::ServerOptions options;
  options.port = 0;
  options.address = "0.0.0.0";
  ASSERT_FALSE(net::Server::open(options, engine).has_value());
  options.insecure = true;
  EXPECT_TRUE(net::Server::open(options, engine).has_value());
  options.insecure = false;
  options.token = kSecret;
  EXPECT_TRUE(net::Server::open(options, engine).has_value());
  options.address = "localhost.example";
  EXPECT_EQ(net::Server::open(options, engine).error().code, ErrorCode::kBadUsage);
}

struct Ran {
  int code = -1;
  std::string output;
};

Ran runProgram(const std::string& arguments) {
  Ran ran;
  std::FILE* pipe = popen((std::string(RADIOSITY_FAKE_SERVER) + " " + arguments + " 2>&1").c_str(), "r");
  std::array<char, 4096> chunk{};
  while (const auto n = std::fread(chunk.data(), 1, chunk.size(), pipe)) ran.output.append(chunk.data(), n);
  ran.code = WEXITSTATUS(pclose(pipe));
  return ran;
}

TEST(CommandLine, ExitCodesTellUsageFromFailure) {
  EXPECT_EQ(runProgram("--help").code, 0);
  EXPECT_THAT(runProgram("--help").output, HasSubstr("--max-upload"));
  EXPECT_EQ(runProgram("--version").code, 0);
  EXPECT_EQ(runProgram("--no-such-option").code, 2);
  EXPECT_EQ(runProgram("--listen nowhere").code, 2);
  EXPECT_EQ(runProgram("--listen 0.0.0.0:0").code, 2);
  EXPECT_EQ(runProgram("--error 0").code, 2);
  EXPECT_EQ(runProgram("--token-file /nonexistent").code, 2);
  RunningServer server;
  const auto taken = runProgram("--listen 127.0.0.1:" + std::to_string(server.port()));
  EXPECT_EQ(taken.code, 1);
  EXPECT_EQ(std::count(taken.output.begin(), taken.output.end(), '\n'), 1) << taken.output;
}

TEST(Access, TokensAndOriginsAreComparedWhole) {
  EXPECT_TRUE(net::sameSecret("abc", "abc"));
  EXPECT_FALSE(net::sameSecret("abd", "abc"));
  EXPECT_FALSE(net::sameSecret("ab", "abc"));
  EXPECT_FALSE(net::sameSecret("abcabc", "abc"));
  EXPECT_FALSE(net::sameSecret("", "abc"));
  net::ServerOptions options;
  options.allow_origins = {"https://a.example"};
  EXPECT_TRUE(net::originAllowed("", "localhost:1", options));
  EXPECT_TRUE(net::originAllowed("http://localhost:1", "localhost:1", options));
  EXPECT_FALSE(net::originAllowed("http://localhost:2", "localhost:1", options));
  EXPECT_FALSE(net::originAllowed("null", "localhost:1", options));
  EXPECT_TRUE(net::originAllowed("https://A.example", "localhost:1", options));
  EXPECT_FALSE(net::originAllowed("https://a.example.evil", "localhost:1", options));
}

}  // namespace
}  // namespace radiosity::testing
