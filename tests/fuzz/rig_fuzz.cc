// Cages and handles from any numbers: the arrays of a request.
//
// Input: dimension, number of vertices and flags, one byte each; the vertices'
// coordinates as doubles; the rest as corners, one byte each.
#include <cmath>
#include <cstring>
#include <string>

#include "core/base/error.h"
#include "core/mesh/cage.h"
#include "core/mesh/handles.h"
#include "tests/fuzz/expect.h"

namespace deform {
namespace {

class Input {
 public:
  Input(const uint8_t* data, size_t size) : data_(data), left_(size) {}

  size_t left() const { return left_; }

  // The next value; 0 after the end.
  template <typename T>
  T Take() {
    T value{};
    if (left_ < sizeof(T)) {
      left_ = 0;
      return value;
    }
    std::memcpy(&value, data_, sizeof(T));
    data_ += sizeof(T);
    left_ -= sizeof(T);
    return value;
  }

 private:
  const uint8_t* data_;
  size_t left_;
};

void CheckRefusal(const absl::Status& status) {
  FUZZ_EXPECT(status.code() == absl::StatusCode::kInvalidArgument);
  FUZZ_EXPECT(!DetailOf(status).reason.empty());
  FUZZ_EXPECT(!DetailOf(status).field.empty());
  FUZZ_EXPECT(!status.message().empty());
}

void CheckCage(const Cage& cage) {
  FUZZ_EXPECT(std::isfinite(cage.diagonal()) && cage.diagonal() > 0);
  // What it accepts, it accepts again, whichever way round it is asked.
  FUZZ_EXPECT(
      Cage::Create(cage.dimension(), cage.vertices(), cage.faces()).ok());
  FUZZ_EXPECT(std::isfinite(WindingNumber(cage, cage.vertices().row(0))));
}

void Check(Input input) {
  const int dimension = input.Take<uint8_t>() % 4;
  const int vertices = input.Take<uint8_t>() % 64;
  const auto orientation = input.Take<uint8_t>() % 2 == 0
                               ? Cage::Orientation::kAsGiven
                               : Cage::Orientation::kFlipIfInsideOut;
  Positions positions = Positions::Zero(vertices, 3);
  for (int i = 0; i < vertices; ++i) {
    for (int k = 0; k < dimension && k < 3; ++k) {
      positions(i, k) = input.Take<double>();
    }
  }
  const int corners = dimension == 2 ? 2 : 3;
  Faces faces(input.left() / corners, corners);
  for (int32_t& corner : faces.reshaped<Eigen::RowMajor>()) {
    corner = input.Take<int8_t>();
  }
  const auto cage = Cage::Create(dimension, positions, faces, orientation);
  cage.ok() ? CheckCage(*cage) : CheckRefusal(cage.status());
  const auto handles = Handles::Create(dimension, positions);
  if (!handles.ok()) CheckRefusal(handles.status());
}

}  // namespace
}  // namespace deform

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  deform::Check(deform::Input(data, size));
  return 0;
}
