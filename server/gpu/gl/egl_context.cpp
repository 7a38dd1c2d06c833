#include "server/gpu/gl/egl_context.h"

#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>

#include <array>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "common/check.h"
#include "common/log.h"

namespace radiosity::gpu {
namespace {

bool hasExtension(const char* list, std::string_view name) {
  if (list == nullptr) return false;
  std::string_view rest(list);
  while (!rest.empty()) {
    const auto space = rest.find(' ');
    if (rest.substr(0, space) == name) return true;
    if (space == std::string_view::npos) break;
    rest.remove_prefix(space + 1);
  }
  return false;
}

std::string eglErrorText() {
  switch (const auto error = eglGetError()) {
    case EGL_NOT_INITIALIZED:
      return "EGL_NOT_INITIALIZED";
    case EGL_BAD_ACCESS:
      return "EGL_BAD_ACCESS";
    case EGL_BAD_ALLOC:
      return "EGL_BAD_ALLOC";
    case EGL_BAD_MATCH:
      return "EGL_BAD_MATCH";
    case EGL_BAD_PARAMETER:
      return "EGL_BAD_PARAMETER";
    case EGL_BAD_ATTRIBUTE:
      return "EGL_BAD_ATTRIBUTE";
    case EGL_BAD_CONFIG:
      return "EGL_BAD_CONFIG";
    case EGL_BAD_DISPLAY:
      return "EGL_BAD_DISPLAY";
    default:
      return fmt::format("EGL error {:#x}", error);
  }
}

/// A place to look for a driver.
struct Candidate {
  std::string name;
  EGLenum platform = 0;
  void* native = nullptr;
};

std::vector<Candidate> deviceCandidates(const char* extensions, bool software, std::vector<std::string>& failures) {
  std::vector<Candidate> found;
  const bool enumerable =
      hasExtension(extensions, "EGL_EXT_device_base") ||
      (hasExtension(extensions, "EGL_EXT_device_enumeration") && hasExtension(extensions, "EGL_EXT_device_query"));
  if (!enumerable || !hasExtension(extensions, "EGL_EXT_platform_device")) {
    if (!software) failures.emplace_back("devices: EGL_EXT_platform_device is missing");
    return found;
  }
  const auto query_devices = reinterpret_cast<PFNEGLQUERYDEVICESEXTPROC>(eglGetProcAddress("eglQueryDevicesEXT"));
  const auto query_string =
      reinterpret_cast<PFNEGLQUERYDEVICESTRINGEXTPROC>(eglGetProcAddress("eglQueryDeviceStringEXT"));
  std::vector<EGLDeviceEXT> devices(32);
  EGLint count = 0;
  if (query_devices == nullptr || query_string == nullptr ||
      query_devices(static_cast<EGLint>(devices.size()), devices.data(), &count) == EGL_FALSE) {
    if (!software) failures.emplace_back("devices: eglQueryDevicesEXT failed");
    return found;
  }
  for (EGLint i = 0; i < count; ++i) {
    const auto device = devices[static_cast<std::size_t>(i)];
    const bool is_software = hasExtension(query_string(device, EGL_EXTENSIONS), "EGL_MESA_device_software");
    if (is_software == software) {
      found.push_back({fmt::format("{}device {}", software ? "software " : "", i), EGL_PLATFORM_DEVICE_EXT, device});
    }
  }
  if (found.empty() && !software) failures.emplace_back("devices: no hardware device");
  return found;
}

std::vector<Candidate> candidates(std::vector<std::string>& failures) {
  const char* extensions = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  if (!hasExtension(extensions, "EGL_EXT_platform_base")) {
    failures.emplace_back("EGL client extension EGL_EXT_platform_base is missing");
    return {};
  }
  auto all = deviceCandidates(extensions, false, failures);
  if (hasExtension(extensions, "EGL_MESA_platform_surfaceless")) {
    all.push_back({"surfaceless", EGL_PLATFORM_SURFACELESS_MESA, nullptr});
  } else {
    failures.emplace_back("surfaceless: EGL_MESA_platform_surfaceless is missing");
  }
  for (auto& device : deviceCandidates(extensions, true, failures)) all.push_back(std::move(device));
  return all;
}

bool debugWanted() { return std::getenv("RADIOSITY_GL_DEBUG") != nullptr; }

/// `robust`: a driver that resets the card says so afterwards; not every driver can.
EGLContext createContext(EGLDisplay display, EGLConfig config, bool robust) {
  const std::array<EGLint, 11> attributes = {EGL_CONTEXT_MAJOR_VERSION_KHR,
                                             4,
                                             EGL_CONTEXT_MINOR_VERSION_KHR,
                                             5,
                                             EGL_CONTEXT_OPENGL_PROFILE_MASK_KHR,
                                             EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT_KHR,
                                             EGL_CONTEXT_FLAGS_KHR,
                                             debugWanted() ? EGL_CONTEXT_OPENGL_DEBUG_BIT_KHR : 0,
                                             robust ? EGL_CONTEXT_OPENGL_RESET_NOTIFICATION_STRATEGY_KHR : EGL_NONE,
                                             EGL_LOSE_CONTEXT_ON_RESET_KHR,
                                             EGL_NONE};
  return eglCreateContext(display, config, EGL_NO_CONTEXT, attributes.data());
}

/// The display and context of one candidate, or why not. A display is never terminated: eglTerminate ends it for every
/// other context of the process too (EGL does not count uses), and the process's end frees it.
tl::expected<std::pair<EGLDisplay, EGLContext>, std::string> open(const Candidate& candidate) {
  const auto get_display =
      reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(eglGetProcAddress("eglGetPlatformDisplayEXT"));
  if (get_display == nullptr) return tl::unexpected(std::string("eglGetPlatformDisplayEXT is missing"));
  const EGLDisplay display = get_display(candidate.platform, candidate.native, nullptr);
  if (display == EGL_NO_DISPLAY) return tl::unexpected("no display: " + eglErrorText());
  if (eglInitialize(display, nullptr, nullptr) == EGL_FALSE) {
    return tl::unexpected("eglInitialize failed: " + eglErrorText());
  }
  const char* extensions = eglQueryString(display, EGL_EXTENSIONS);
  for (const auto* needed : {"EGL_KHR_create_context", "EGL_KHR_surfaceless_context"}) {
    if (!hasExtension(extensions, needed)) return tl::unexpected(std::string(needed) + " is missing");
  }
  if (eglBindAPI(EGL_OPENGL_API) == EGL_FALSE) return tl::unexpected("no desktop OpenGL: " + eglErrorText());
  const EGLint config_attributes[] = {EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_SURFACE_TYPE, 0, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  if (eglChooseConfig(display, config_attributes, &config, 1, &count) == EGL_FALSE || count == 0) {
    return tl::unexpected("no OpenGL configuration: " + eglErrorText());
  }
  auto context = createContext(display, config, true);
  if (context == EGL_NO_CONTEXT) context = createContext(display, config, false);
  if (context == EGL_NO_CONTEXT) return tl::unexpected("no OpenGL 4.5 core context: " + eglErrorText());
  if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) == EGL_FALSE) {
    const auto reason = eglErrorText();
    eglDestroyContext(display, context);
    return tl::unexpected("eglMakeCurrent failed: " + reason);
  }
  return std::pair{display, context};
}

const char* resetText(GLenum reset) {
  switch (reset) {
    case GL_GUILTY_CONTEXT_RESET:
      return "our own work made the driver reset the card";
    case GL_INNOCENT_CONTEXT_RESET:
      return "another program made the driver reset the card";
    default:
      return "the driver reset the card";
  }
}

void GLAPIENTRY onDebugMessage(GLenum /*source*/, GLenum type, GLuint id, GLenum severity, GLsizei length,
                               const GLchar* message, const void* fatal) {
  const bool error = type == GL_DEBUG_TYPE_ERROR || type == GL_DEBUG_TYPE_UNDEFINED_BEHAVIOR;
  if (!error && severity != GL_DEBUG_SEVERITY_HIGH) return;
  const std::string text(message, static_cast<std::size_t>(length));
  log::error("OpenGL: {} ({:#x})", text, id);
  if (fatal != nullptr && error) detail::checkFailed(__FILE__, __LINE__, "OpenGL error: " + text);
}

}  // namespace

Result<std::unique_ptr<EglContext>> EglContext::create() {
  // libepoxy ends the program when the library is missing, so ask first.
  if (dlopen("libEGL.so.1", RTLD_LAZY | RTLD_GLOBAL) == nullptr) {
    return fail(ErrorCode::kUnavailable,
                "OpenGL needs libEGL.so.1, which cannot be loaded; install libegl1 (and libgl1-mesa-dri for a software "
                "renderer)");
  }
  std::vector<std::string> failures;
  for (const auto& candidate : candidates(failures)) {
    auto opened = open(candidate);
    if (!opened) {
      failures.push_back(candidate.name + ": " + opened.error());
      continue;
    }
    auto context = std::unique_ptr<EglContext>(new EglContext(opened->first, opened->second, candidate.name));
    if (!epoxy_has_gl_extension("GL_ARB_shader_viewport_layer_array") && epoxy_gl_version() < 46) {
      failures.push_back(candidate.name + ": GL_ARB_shader_viewport_layer_array is missing on " + context->renderer());
      continue;
    }
    return context;
  }
  std::string all;
  for (const auto& failure : failures) all += (all.empty() ? "" : "; ") + failure;
  return fail(ErrorCode::kUnavailable, "no headless OpenGL 4.5 core context. Tried " + all);
}

EglContext::EglContext(void* display, void* context, std::string platform)
    : display_(display), context_(context), platform_(std::move(platform)) {
  renderer_ = reinterpret_cast<const char*>(glGetString(GL_RENDERER));
  for (const auto* name : {"llvmpipe", "softpipe", "SWR", "swrast"}) {
    software_ = software_ || renderer_.find(name) != std::string::npos;
  }
  static const int kFatal = 1;
  if (debugWanted()) {
    glEnable(GL_DEBUG_OUTPUT);
    glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
  }
  glDebugMessageCallback(onDebugMessage, debugWanted() ? &kFatal : nullptr);
}

EglContext::~EglContext() {
  if (eglGetCurrentContext() == context_) {
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  }
  eglDestroyContext(display_, context_);
}

Result<void> EglContext::check() const {
  makeCurrent();
  if (const auto reset = glGetGraphicsResetStatus(); reset != GL_NO_ERROR)
    return fail(ErrorCode::kUnavailable, fmt::format("the graphics context was lost: {}", resetText(reset)), renderer_);
  const auto error = glGetError();
  if (error == GL_NO_ERROR) return {};
  constexpr int kMostFlags = 16;  // one for each kind of error; a lost context may report for ever
  for (int i = 0; i < kMostFlags && glGetError() != GL_NO_ERROR; ++i) {
  }
  if (error == GL_CONTEXT_LOST) return fail(ErrorCode::kUnavailable, "the graphics context was lost", renderer_);
  if (error == GL_OUT_OF_MEMORY)
    return fail(ErrorCode::kUnavailable,
                "the graphics driver is out of memory; fewer --workers, or fewer texels, need less", renderer_);
  return fail(ErrorCode::kInternal, fmt::format("OpenGL refused a call with error {:#x}", error), renderer_);
}

void EglContext::makeCurrent() const {
  if (eglGetCurrentContext() == context_) return;
  RAD_CHECK(eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) == EGL_TRUE);
}

}  // namespace radiosity::gpu
