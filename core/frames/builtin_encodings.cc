#include "core/base/error.h"
#include "core/frames/encoding.h"

// To add an encoding: write encodings/<name>.cc with a function
// <Name>Encoding(), then add one line here. The cheapest comes last.
#define DEFORM_ENCODINGS(X) \
  X(Float32)                \
  X(Quantized16)            \
  X(Predicted)              \
  X(Basis)                  \
  X(Pose)

namespace deform {

#define DEFORM_DECLARE(name) const FrameEncoding& name##Encoding();
DEFORM_ENCODINGS(DEFORM_DECLARE)
#undef DEFORM_DECLARE

std::span<const FrameEncoding* const> AllEncodings() {
#define DEFORM_ADDRESS(name) &name##Encoding(),
  static const FrameEncoding* const encodings[] = {
      DEFORM_ENCODINGS(DEFORM_ADDRESS)};
#undef DEFORM_ADDRESS
  return encodings;
}

const FrameEncoding* FindEncoding(absl::string_view id) {
  for (const FrameEncoding* encoding : AllEncodings()) {
    if (encoding->id() == id) return encoding;
  }
  return nullptr;
}

absl::Status BadFrameData(absl::string_view message) {
  return InvalidInput("BAD_FRAME", "frame.data", message);
}

}  // namespace deform
