#include "server/net/status_page.h"

#include <fmt/format.h>

#include "common/printable.h"
#include "server/net/convert.h"

namespace radiosity::net {
namespace {

constexpr std::size_t kWarningsShown = 20;

constexpr std::string_view kHead = R"(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
{}<title>radiosityd: {}</title>
<link rel="icon" href="/favicon.svg" type="image/svg+xml">
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 62rem; padding: 0 1rem; color: #222; }}
table {{ border-collapse: collapse; }}
td {{ padding: .1rem 1.5rem .1rem 0; }}
td + td {{ font-variant-numeric: tabular-nums; }}
img {{ max-width: 100%; background: #eee; margin: 1rem 0; }}
</style>
</head>
<body>
<h1>radiosityd {}</h1>
)";

std::string row(std::string_view name, std::string_view value) {
  return fmt::format("<tr><td>{}</td><td>{}</td></tr>\n", name, htmlEscaped(value));
}

}  // namespace

std::string htmlEscaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string statusPage(const engine::Status& s, std::size_t viewers, std::string_view version) {
  const bool moving = !hasStopped(s.state) && s.state != engine::SolveState::kPaused;
  const auto refresh = moving ? "<meta http-equiv=\"refresh\" content=\"2\">\n" : "";
  auto page = fmt::format(fmt::runtime(kHead), refresh, stateName(s.state), htmlEscaped(version));
  page += "<table>\n";
  page += row("State", s.failure.empty() ? std::string(stateName(s.state))
                                         : fmt::format("{}: {}", stateName(s.state), s.failure));
  if (!s.state_trouble.empty()) page += row("Edits are refused", printable(s.state_trouble));
  page += row("Scene revision", std::to_string(s.revision));
  const auto target = fmt::format(" (target {:.2f} %)", 100 * s.settings.target_error);
  const bool chooses = s.settings.choosesTexels();
  page += row("Estimated error", s.unlit.empty() ? fmt::format("{:.2f} %{}", 100 * s.error.total, chooses ? target : "")
                                                 : "no light arrives: " + s.unlit);
  if (!chooses && s.unlit.empty())
    page += row("Of texels alone", fmt::format("{:.2f} %{}", 100 * s.error.texels, target));
  page += row("Solve time", fmt::format("{:.2f} s", s.seconds));
  if (s.seconds_left) page += row("Time left, about", fmt::format("{:.0f} s", *s.seconds_left));
  page += row("Shots", fmt::format("{} ({:.0f} a second)", s.shots, s.shots_per_second));
  page += row("Patches", fmt::format("{} on {} surfaces of {} polygons", s.patches, s.surfaces, s.polygons));
  page += row("Renderer", s.gl_renderer);
  page += row("Viewers", std::to_string(viewers));
  page += "</table>\n";
  if (s.state == engine::SolveState::kEmpty) {
    page += "<p>No scene yet. Send one: <code>curl -T room.glb http://HOST:PORT/scene</code></p>\n";
  } else {
    page += fmt::format("<p><img src=\"/snapshot.png?width=960&amp;height=720&amp;v={}\" alt=\"the lit scene\"></p>\n",
                        s.tile_version);
    page +=
        "<p><a href=\"/scene.glb\">scene.glb</a> (with lightmap UVs) · "
        "<a href=\"/scene-unlit.glb\">scene-unlit.glb</a> (for any glTF viewer) · "
        "<a href=\"/lightmaps/0.exr\">lightmap 0</a> · <a href=\"/metrics\">metrics</a></p>\n";
  }
  if (!s.warnings.empty()) page += "<h2>Warnings</h2>\n<ul>\n";
  for (std::size_t i = 0; i < s.warnings.size() && i < kWarningsShown; ++i)
    page += fmt::format("<li>{}</li>\n", htmlEscaped(s.warnings[i]));
  if (s.warning_count > kWarningsShown) page += fmt::format("<li>and {} more</li>\n", s.warning_count - kWarningsShown);
  if (!s.warnings.empty()) page += "</ul>\n";
  return page + "</body>\n</html>\n";
}

}  // namespace radiosity::net
