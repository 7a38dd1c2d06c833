// A headless OpenGL 4.5 core context. Created, used and destroyed by one thread. Several may exist in a thread; each
// owner calls makeCurrent() before it speaks GL.
#pragma once

#include <memory>
#include <string>

#include "common/result.h"

namespace radiosity::gpu {

class EglContext {
 public:
  /// Real GPUs first (device platform), then Mesa's surfaceless platform, then software devices.
  /// kUnavailable names everything tried and why it failed. With RADIOSITY_GL_DEBUG set in the environment the context
  /// is a debug context and a driver's error message ends the program (tests).
  [[nodiscard]] static Result<std::unique_ptr<EglContext>> create();

  ~EglContext();
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  /// Cheap when it is current already.
  void makeCurrent() const;

  /// What went wrong on the context since the last check, if anything: kUnavailable when it was lost (a driver reset
  /// the card) or memory ran out, kInternal for a call that OpenGL refused. What was drawn since then is void. Costs a
  /// few calls of the driver; to be asked once for each piece of work that was read back.
  [[nodiscard]] Result<void> check() const;

  /// GL_RENDERER: "llvmpipe (LLVM 15.0.6, 256 bits)"
  [[nodiscard]] const std::string& renderer() const { return renderer_; }
  /// True when a CPU does the drawing.
  [[nodiscard]] bool software() const { return software_; }
  /// "surfaceless", "device 0"
  [[nodiscard]] const std::string& platform() const { return platform_; }

 private:
  EglContext(void* display, void* context, std::string platform);

  void* display_;
  void* context_;
  std::string platform_, renderer_;
  bool software_ = false;
};

}  // namespace radiosity::gpu
