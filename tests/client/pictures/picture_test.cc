#include "client/pictures/picture.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>

#include <cstdlib>
#include <fstream>
#include <functional>

namespace deform {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

Positions Cube(double size) {
  Positions corners(8, 3);
  for (int i = 0; i < 8; ++i) {
    corners.row(i) << (i & 1) * size, (i >> 1 & 1) * size, (i >> 2) * size;
  }
  return corners;
}

Faces CubeFaces() {
  Faces faces(12, 3);
  faces << 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7,
      3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5;
  return faces;
}

Picture CubePicture() {
  Picture picture;
  picture.width = picture.height = 120;
  picture.faces = CubeFaces();
  picture.panels = {{.positions = Cube(1), .rig = Positions(0, 3)}};
  return picture;
}

// Brown, as the model is, on any side of it.
bool IsModel(Color c) { return c.r > c.b + 20; }
bool IsRig(Color c) { return c.b > c.r + 25; }
bool IsGround(Color c) { return c.r > 220 && c.b > 220; }

int Count(const Image& image, bool (*is)(Color)) {
  return static_cast<int>(
      std::count_if(image.pixels.begin(), image.pixels.end(), is));
}

TEST(Picture, ShowsTheModelInTheMiddleOfLightGround) {
  const Image image = DrawPicture(CubePicture()).value();
  EXPECT_EQ(image.width, 120);
  EXPECT_TRUE(IsModel(image.at(60, 60)));
  for (const auto& [x, y] : {std::pair{0, 0}, {119, 0}, {0, 119}, {119, 119}}) {
    EXPECT_TRUE(IsGround(image.at(x, y)));
  }
  const int covered = Count(image, IsModel);
  EXPECT_GT(covered, 120 * 120 / 4);
  EXPECT_LT(covered, 120 * 120 * 3 / 4);
}

TEST(Picture, ShadesFacesByTheirDirection) {
  Picture picture = CubePicture();
  picture.view = ParseView("28,25", View::Up::kY).value();
  const Image image = DrawPicture(picture).value();
  // Top, front and right side of the cube.
  EXPECT_GT(image.at(60, 25).g, image.at(85, 75).g + 20);
  EXPECT_GT(image.at(40, 75).g, image.at(90, 75).g + 10);
}

TEST(Picture, SmoothsEdges) {
  const Image image = DrawPicture(CubePicture()).value();
  const int between =
      Count(image, [](Color c) { return !IsModel(c) && !IsGround(c); });
  EXPECT_GT(between, 20) << "no pixel lies between model and ground";
}

TEST(Picture, DrawsTheCageAsWires) {
  Picture picture = CubePicture();
  picture.width = picture.height = 400;
  const int without = Count(DrawPicture(picture).value(), IsRig);
  picture.rig_faces = CubeFaces();
  picture.panels[0].rig = Cube(1.3).array() - 0.15;
  const int with = Count(DrawPicture(picture).value(), IsRig);
  EXPECT_EQ(without, 0);
  EXPECT_GT(with, 400);
  EXPECT_LT(with, 400 * 400 / 10) << "wires, not faces";
}

TEST(Picture, DrawsHandlesAsDots) {
  Picture picture = CubePicture();
  picture.panels[0].rig = Cube(1.5).array() - 0.25;
  const int dots = Count(DrawPicture(picture).value(), IsRig);
  EXPECT_GT(dots, 4);
  EXPECT_LT(dots, 200);
}

TEST(Picture, SetsPanelsSideBySideAtOneScale) {
  Picture picture = CubePicture();
  picture.panels.push_back(picture.panels[0]);
  picture.panels[0].positions = Cube(1).array() - 0.5;
  picture.panels[1].positions = Cube(0.5).array() - 0.25;
  const Image image = DrawPicture(picture).value();
  ASSERT_EQ(image.width, 240);
  int left = 0;
  int right = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      (x < 120 ? left : right) += IsModel(image.at(x, y)) ? 1 : 0;
    }
  }
  EXPECT_GT(right, 0);
  EXPECT_NEAR(static_cast<double>(left) / right, 4, 0.8)
      << "half as large is a quarter of the area";
}

TEST(Picture, WritesTheCaption) {
  Picture picture = CubePicture();
  picture.width = picture.height = 600;
  const auto dark = [](Color c) { return c.r < 140 && c.b < 150; };
  const int without = Count(DrawPicture(picture).value(), dark);
  picture.panels[0].caption = "rest: 8 vertices";
  EXPECT_GT(Count(DrawPicture(picture).value(), dark), without + 80);
}

TEST(Picture, ShowsA2dModelWithAPatternThatFollowsIt) {
  Picture picture;
  picture.dimension = 2;
  picture.width = picture.height = 120;
  picture.faces.resize(2, 3);
  picture.faces << 0, 1, 2, 0, 2, 3;
  Positions square(4, 3);
  square << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0;
  picture.panels = {{.positions = square, .rig = Positions(0, 3)},
                    {.positions = square, .rig = Positions(0, 3)}};
  picture.panels[1].positions.col(0) *= 0.5;
  const Image image = DrawPicture(picture).value();
  // Changes of tile along the middle row: as many in the squeezed panel.
  const auto changes = [&](int from, int to) {
    int count = 0;
    bool light = false;
    for (int x = from; x < to; ++x) {
      const Color c = image.at(x, 57);
      if (!IsModel(c)) continue;
      const bool now = c.g > 170;
      if (now != light) ++count;
      light = now;
    }
    return count;
  };
  EXPECT_NEAR(changes(10, 110), 16, 1);
  EXPECT_NEAR(changes(130, 240), changes(10, 110), 2);
}

TEST(Picture, ShowsAPointSetAsDots) {
  Picture picture = CubePicture();
  picture.width = picture.height = 300;
  picture.faces.resize(0, 3);
  const int dots = Count(DrawPicture(picture).value(), IsModel);
  EXPECT_GT(dots, 4);
  EXPECT_LT(dots, 400);
}

TEST(Picture, SurvivesCollapsedAndHugeModels) {
  Picture picture = CubePicture();
  picture.panels[0].positions.setConstant(5);
  EXPECT_TRUE(DrawPicture(picture).ok());
  picture.panels[0].positions = Cube(1e90);
  EXPECT_TRUE(IsModel(DrawPicture(picture).value().at(60, 60)));
  picture.panels[0].positions = Cube(1e-90);
  EXPECT_TRUE(IsModel(DrawPicture(picture).value().at(60, 60)));
}

// Yellow is the upper end of the scale.
bool IsHigh(Color c) { return c.r > c.b + 60 && c.g > c.b + 60; }
// Violet the lower.
bool IsLow(Color c) { return c.b > c.g + 20 && c.r < 120 && c.g < 60; }

TEST(Picture, ColoursAModelByItsValues) {
  Picture picture = CubePicture();
  picture.view = ParseView("front", View::Up::kY).value();
  for (int i = 0; i < 8; ++i) {
    picture.panels[0].values.push_back(i & 1);  // From left to right.
  }
  const Image image = DrawPicture(picture).value();
  EXPECT_TRUE(IsLow(image.at(12, 60)));
  EXPECT_TRUE(IsHigh(image.at(108, 60)));
  EXPECT_FALSE(IsLow(image.at(60, 60)));
  EXPECT_FALSE(IsHigh(image.at(60, 60)));
}

TEST(Picture, ShowsValuesOfPointsAndOfFlatModelsToo) {
  for (const int dimension : {2, 3}) {
    Picture picture = CubePicture();
    picture.dimension = dimension;
    picture.width = picture.height = 600;
    picture.panels[0].positions.col(2).setZero();
    picture.faces = dimension == 2 ? Faces(picture.faces.topRows(2)) : Faces();
    for (int i = 0; i < 8; ++i) picture.panels[0].values.push_back(i & 1);
    const Image image = DrawPicture(picture).value();
    EXPECT_GT(Count(image, IsLow), dimension == 2 ? 300 : 4);
    EXPECT_GT(Count(image, IsHigh), dimension == 2 ? 300 : 4);
  }
}

TEST(Picture, LeavesUnknownValuesGrey) {
  Picture picture = CubePicture();
  picture.panels[0].values.assign(8, std::nan(""));
  const Color middle = DrawPicture(picture)->at(60, 60);
  EXPECT_NEAR(middle.r, middle.g, 8);
  EXPECT_NEAR(middle.g, middle.b, 8);
}

TEST(Picture, ShowsHandlesBesideACage) {
  Picture picture = CubePicture();
  picture.rig_faces = CubeFaces();
  picture.panels[0].rig = Cube(1.5).array() - 0.25;
  const int wires = Count(DrawPicture(picture).value(), IsRig);
  picture.panels[0].rig_is_handles = true;
  const int dots = Count(DrawPicture(picture).value(), IsRig);
  EXPECT_GT(dots, 0);
  EXPECT_LT(dots, wires);
}

struct BadCase {
  const char* name;
  std::function<void(Picture&)> spoil;
  const char* message;
};
void PrintTo(const BadCase& test, std::ostream* out) { *out << test.name; }

class PictureRefuses : public testing::TestWithParam<BadCase> {};

TEST_P(PictureRefuses, BadInput) {
  Picture picture = CubePicture();
  GetParam().spoil(picture);
  const absl::StatusOr<Image> image = DrawPicture(picture);
  ASSERT_FALSE(image.ok());
  EXPECT_THAT(std::string(image.status().message()),
              HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Pictures, PictureRefuses,
    testing::ValuesIn<BadCase>({
        {"TooLarge", [](Picture& p) { p.width = 4097; }, "not 4097"},
        {"TooSmall", [](Picture& p) { p.height = 63; }, "not 63"},
        {"NoPanel", [](Picture& p) { p.panels.clear(); }, "nothing to draw"},
        {"NoPoints", [](Picture& p) { p.panels[0].positions.resize(0, 3); },
         "nothing to draw"},
        {"BadFace", [](Picture& p) { p.faces(3, 1) = 8; },
         "face 3 refers to vertex 8 of 8"},
        {"BadRigFace",
         [](Picture& p) {
           p.rig_faces = p.faces;
           p.rig_faces(0, 0) = -1;
           p.panels[0].rig = p.panels[0].positions;
         },
         "face 0 refers to vertex -1 of 8"},
        {"Values",
         [](Picture& p) {
           p.panels[0].values = {1, 2};
         },
         "a panel has 2 values for 8 points"},
        {"NotFinite",
         [](Picture& p) { p.panels[0].positions(2, 1) = std::nan(""); },
         "vertex 2 has a coordinate that is not finite"},
        {"OtherPanel",
         [](Picture& p) {
           p.panels.push_back(p.panels[0]);
           p.panels[1].positions.conservativeResize(7, 3);
         },
         "8 points, another 7"},
    }),
    [](const auto& test) { return test.param.name; });

TEST(Png, HoldsThePixels) {
  Image image{3,
              2,
              {{1, 2, 3},
               {4, 5, 6},
               {7, 8, 9},
               {10, 11, 12},
               {13, 14, 15},
               {255, 0, 128}}};
  const std::string bytes = EncodePng(image);
  png_image read{};
  read.version = PNG_IMAGE_VERSION;
  ASSERT_TRUE(
      png_image_begin_read_from_memory(&read, bytes.data(), bytes.size()));
  ASSERT_EQ(read.width, 3u);
  ASSERT_EQ(read.height, 2u);
  read.format = PNG_FORMAT_RGB;
  std::vector<Color> pixels(6);
  ASSERT_TRUE(png_image_finish_read(&read, nullptr, pixels.data(), 0, nullptr));
  EXPECT_EQ(pixels, image.pixels);
}

TEST(Png, SaysWhereItCouldNotBeWritten) {
  const absl::Status status =
      WritePng(Image{1, 1, {Color{}}}, "/nonexistent/folder/x.png");
  EXPECT_THAT(
      std::string(status.message()),
      StartsWith("/nonexistent/folder/x.png: cannot be written: No such"));
}

}  // namespace
}  // namespace deform
