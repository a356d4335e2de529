#include "server/models/catalogue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>

namespace deform::server {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

using Things = Catalogue<const std::string>;

std::shared_ptr<const std::string> Thing(const std::string& text) {
  return std::make_shared<const std::string>(text);
}

std::vector<std::string> Texts(const Page<const std::string>& page) {
  std::vector<std::string> texts;
  for (const auto& record : page.records) texts.push_back(*record);
  return texts;
}

bool Everything(const std::string&) { return true; }

TEST(Catalogue, KeepsTheFirstRecordOfAnId) {
  Things things("thing", 10, "max-things");
  EXPECT_FALSE(things.Insert("t", "1", Thing("first")).value().second);
  const auto again = things.Insert("t", "1", Thing("second")).value();
  EXPECT_TRUE(again.second);
  EXPECT_EQ(*again.first, "first");
}

TEST(Catalogue, DoesNotShowOneTenantWhatAnotherHas) {
  Things things("thing", 10, "max-things");
  ASSERT_TRUE(things.Insert("a", "1", Thing("of a")).ok());
  EXPECT_EQ(things.Find("b", "1").status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(Texts(things.List("b", {}, Everything)), IsEmpty());
  EXPECT_FALSE(things.Remove("b", "1").ok());
  EXPECT_FALSE(things.Insert("b", "1", Thing("of b")).value().second);
  EXPECT_EQ(**things.Find("a", "1"), "of a");
}

TEST(Catalogue, NamesWhatItDoesNotFind) {
  const Things things("thing", 10, "max-things");
  const absl::Status status = things.Find("t", "x1").status();
  EXPECT_EQ(status.message(), "no thing \"x1\"");
  EXPECT_EQ(DetailOf(status).reason, "THING_NOT_FOUND");
  EXPECT_EQ(DetailOf(status).resource_type, "thing");
  EXPECT_EQ(DetailOf(status).resource_name, "x1");
}

TEST(Catalogue, RefusesMoreThanItsLimit) {
  Things things("thing", 1, "max-things");
  ASSERT_TRUE(things.Insert("a", "1", Thing("")).ok());
  const absl::Status status = things.Insert("b", "2", Thing("")).status();
  EXPECT_EQ(status.message(),
            "the server holds 1 things, its limit (max-things)");
  EXPECT_EQ(DetailOf(status).reason, "TOO_MANY_THINGS");
  ASSERT_TRUE(things.Remove("a", "1").ok());
  EXPECT_TRUE(things.Insert("b", "2", Thing("")).ok());
}

TEST(Catalogue, DoesNotRemoveWhatIsUsedAndNamesTheUser) {
  Things things("thing", 10, "max-things");
  ASSERT_TRUE(things.Insert("t", "1", Thing("")).ok());
  {
    const auto lease = things.Use("t", "1", "session one").value();
    const auto other = things.Use("t", "1", "session two").value();
    const absl::Status status = things.Remove("t", "1").status();
    EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_EQ(status.message(),
              "thing \"1\" is used by session one and 1 more");
    EXPECT_EQ(DetailOf(status).reason, "THING_IN_USE");
  }
  EXPECT_TRUE(things.Remove("t", "1").ok());
}

TEST(Catalogue, AMovedLeaseIsGivenBackOnce) {
  Things things("thing", 10, "max-things");
  ASSERT_TRUE(things.Insert("t", "1", Thing("")).ok());
  auto lease = things.Use("t", "1", "me").value();
  Things::Lease moved = std::move(lease);
  EXPECT_FALSE(things.Remove("t", "1").ok());
  moved = {};
  EXPECT_TRUE(things.Remove("t", "1").ok());
}

TEST(Catalogue, ListsPagesSortedById) {
  Things things("thing", 10, "max-things");
  for (const char* id : {"d", "b", "e", "a", "c"}) {
    ASSERT_TRUE(things.Insert("t", id, Thing(id)).ok());
  }
  const auto first = things.List("t", {.size = 2}, Everything);
  EXPECT_THAT(Texts(first), ElementsAre("a", "b"));
  const auto second =
      things.List("t", {.size = 2, .after = first.next}, Everything);
  EXPECT_THAT(Texts(second), ElementsAre("c", "d"));
  const auto last =
      things.List("t", {.size = 2, .after = second.next}, Everything);
  EXPECT_THAT(Texts(last), ElementsAre("e"));
  EXPECT_THAT(last.next, IsEmpty());
}

TEST(Catalogue, APageThatEndsWithTheListIsTheLast) {
  Things things("thing", 10, "max-things");
  ASSERT_TRUE(things.Insert("t", "a", Thing("a")).ok());
  ASSERT_TRUE(things.Insert("u", "b", Thing("b")).ok());
  EXPECT_THAT(things.List("t", {.size = 1}, Everything).next, IsEmpty());
}

TEST(Catalogue, ListsOnlyWhatIsWanted) {
  Things things("thing", 10, "max-things");
  for (const char* id : {"a", "b", "c"}) {
    ASSERT_TRUE(things.Insert("t", id, Thing(id)).ok());
  }
  EXPECT_THAT(Texts(things.List("t", {},
                                [](const std::string& s) { return s != "b"; })),
              ElementsAre("a", "c"));
}

}  // namespace
}  // namespace deform::server
