#include "server/gpu/gl/egl_context.h"

#include <epoxy/gl.h>
#include <gtest/gtest.h>

#include <cstdlib>

namespace radiosity::gpu {
namespace {

TEST(EglContext, checkReportsWhatWentWrongOnceAndOnlyWhatWentWrong) {
  // A debug context would end the program at the first error.
  unsetenv("RADIOSITY_GL_DEBUG");
  const auto context = EglContext::create();
  setenv("RADIOSITY_GL_DEBUG", "1", 1);
  ASSERT_TRUE(context) << context.error().text();
  EXPECT_TRUE((*context)->check());
  glEnable(0xffff);
  const auto refused = (*context)->check();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInternal);
  EXPECT_NE(refused.error().text().find("0x500"), std::string::npos) << refused.error().text();
  EXPECT_TRUE((*context)->check());
}

}  // namespace
}  // namespace radiosity::gpu
