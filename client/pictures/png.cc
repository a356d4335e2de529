#include <png.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "client/pictures/image.h"
#include "core/base/error.h"

namespace deform {
namespace {

void Append(png_structp png, png_bytep bytes, png_size_t count) {
  static_cast<std::string*>(png_get_io_ptr(png))
      ->append(reinterpret_cast<const char*>(bytes), count);
}

void NothingToFlush(png_structp /*png*/) {}

}  // namespace

std::string EncodePng(const Image& image) {
  std::string bytes;
  // libpng's own error handler ends the program; what it can complain about
  // here (memory, sizes beyond 2^31) is our mistake.
  png_structp png =
      png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_set_write_fn(png, &bytes, Append, NothingToFlush);
  png_set_IHDR(png, info, image.width, image.height, 8, PNG_COLOR_TYPE_RGB,
               PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_set_sRGB(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
  png_write_info(png, info);
  for (int y = 0; y < image.height; ++y) {
    png_write_row(png, reinterpret_cast<png_const_bytep>(&image.at(0, y)));
  }
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return bytes;
}

absl::Status WritePng(const Image& image, const std::string& path) {
  const std::string bytes = EncodePng(image);
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) {
    return MakeError(
        absl::StatusCode::kPermissionDenied,
        absl::StrCat(path, ": cannot be written: ", std::strerror(errno)),
        {.reason = "FILE_NOT_WRITABLE"});
  }
  return absl::OkStatus();
}

}  // namespace deform
