// Files that were damaged, data directories of others, older and newer ones,
// and copies.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <thread>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "server/stores/array_file.h"
#include "server/stores/backup.h"
#include "server/stores/sqlite.h"
#include "server/stores/store_database.h"
#include "tests/server/stores/samples.h"
#include "tests/server/stores/simulated_disk.h"
#include "tests/support/temporary_folder.h"

namespace deform::server {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

constexpr char kCatalogue[] = "/data/catalogue.sqlite";

StoreOptions On(SimulatedDisk& disk, const std::string& directory = "/data") {
  return {.directory = directory, .files = &disk, .sqlite_vfs = disk.vfs()};
}
absl::StatusOr<std::unique_ptr<Store>> Open(const StoreOptions& options) {
  return (*FindStoreKind("sqlite"))->Open(options);
}
std::unique_ptr<Store> MustOpen(const StoreOptions& options) {
  auto store = Open(options);
  EXPECT_TRUE(store.ok()) << store.status();
  return *std::move(store);
}

std::string Flipped(std::string bytes, size_t at) {
  bytes[at] = static_cast<char>(bytes[at] ^ (1 << (at % 8)));
  return bytes;
}

class ArrayFileTest : public testing::Test {
 protected:
  absl::StatusOr<StoredArrays> Read() {
    return ReadArrayFile(disk_, "/file", "models/ann/m");
  }
  void Write(const StoredArrays& arrays) {
    ASSERT_TRUE(WriteArrayFile(disk_, "/file", "models/ann/m", arrays).ok());
  }
  SimulatedDisk disk_;
};

TEST_F(ArrayFileTest, GivesBackArraysOfEverySizeAlignedTo64) {
  const std::string bytes(3 << 20, '\x5a');
  StoredArrays arrays;
  for (const size_t size : {0u, 1u, 63u, 64u, 65u, (1u << 20) - 1, 1u << 20,
                            (1u << 20) + 1, 3u << 20}) {
    arrays.arrays.push_back(
        {absl::StrCat(size),
         AsBytes(absl::string_view(bytes).substr(0, size))});
  }
  Write(arrays);
  const StoredArrays read = *Read();
  ASSERT_EQ(read.arrays.size(), arrays.arrays.size());
  for (const StoredArrays::Array& array : arrays.arrays) {
    const auto found = read.Find(array.name);
    EXPECT_TRUE(std::equal(found.begin(), found.end(), array.bytes.begin(),
                           array.bytes.end()))
        << array.name;
    EXPECT_EQ(reinterpret_cast<uintptr_t>(found.data()) % 64, 0u);
  }
}

TEST_F(ArrayFileTest, FindsEveryFlippedBit) {
  Write(ArraysOf("the arrays of a model"));
  const std::string right = disk_.Contents("/file");
  for (size_t at = 0; at < right.size(); ++at) {
    disk_.Replace("/file", Flipped(right, at));
    EXPECT_EQ(ReasonOf(Read().status()), "FILE_DAMAGED") << "byte " << at;
  }
}

TEST_F(ArrayFileTest, FindsEveryLengthThatIsNotItsOwn) {
  Write(ArraysOf("the arrays of a model"));
  const std::string right = disk_.Contents("/file");
  for (size_t length = 0; length < right.size(); ++length) {
    disk_.Replace("/file", right.substr(0, length));
    EXPECT_EQ(ReasonOf(Read().status()), "FILE_DAMAGED") << length << " bytes";
  }
  disk_.Replace("/file", right + "x");
  EXPECT_EQ(ReasonOf(Read().status()), "FILE_DAMAGED");
}

TEST_F(ArrayFileTest, FindsTheContentOfAnother) {
  Write(ArraysOf("mesh"));
  const absl::Status status =
      ReadArrayFile(disk_, "/file", "models/bob/m").status();
  EXPECT_THAT(status.message(), HasSubstr("it holds models/ann/m"));
}

TEST_F(ArrayFileTest, SaysWhereItIsDamaged) {
  Write(ArraysOf(std::string(3 << 20, 'x')));
  disk_.Replace("/file", Flipped(disk_.Contents("/file"), (2 << 20) + 5));
  EXPECT_THAT(Read().status().message(),
              HasSubstr("/file is damaged: MiB 2 is not what was written"));
}

TEST_F(ArrayFileTest, RefusesANewerFormatWithoutCallingItDamaged) {
  Write(ArraysOf("mesh"));
  std::string bytes = disk_.Contents("/file");
  ByteReader trailer(AsBytes(bytes).subspan(bytes.size() - 32));
  ByteWriter newer;
  newer.Add(trailer.U64()).Add(uint64_t{2}).AddRaw("deform\r\n", 8);
  bytes.replace(bytes.size() - 32, 32, newer.Seal());
  disk_.Replace("/file", bytes);
  const absl::Status status = Read().status();
  EXPECT_EQ(ReasonOf(status), "FORMAT_TOO_NEW");
  EXPECT_THAT(status.message(),
              HasSubstr("has format 2; this version of deformd knows 1"));
}

class SqliteStoreTest : public testing::Test {
 protected:
  SqliteStoreTest() : store_(MustOpen(On(disk_))) { PutChain(*store_); }
  void Damage(const std::string& path) {
    disk_.Replace(path, Flipped(disk_.Contents(path), 2));
  }
  SimulatedDisk disk_;
  std::unique_ptr<Store> store_;
};

TEST_F(SqliteStoreTest, PutsADamagedModelAsideAndTakesItAgain) {
  Damage("/data/models/ann/model");
  const absl::Status status = store_->ModelArrays(Key("model")).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(status.message(),
              HasSubstr("it is now /data/quarantine/models~ann~model"));
  EXPECT_THAT(disk_.Files(),
              testing::Contains("/data/quarantine/models~ann~model"));
  EXPECT_EQ(store_->ModelArrays(Key("model")).status().code(),
            absl::StatusCode::kDataLoss)
      << "and stays lost";
  ASSERT_TRUE(store_->PutModel(ModelOf(Key("model")), ArraysOf("mesh")).ok());
  EXPECT_EQ(TextOf(*store_->ModelArrays(Key("model"))), "mesh");
}

TEST_F(SqliteStoreTest, PutsDamagedWeightsAsideToBeComputedAgain) {
  const StoreKey bound = Key("bound");
  ASSERT_TRUE(store_->PutWeights(bound, {"tiles", 1}, ArraysOf("many")).ok());
  Damage("/data/weights/ann/bound.tiles-1");
  EXPECT_EQ(ReasonOf(store_->Weights(bound).status()), "FILE_DAMAGED");
  EXPECT_EQ(ReasonOf(store_->Weights(bound).status()), "WEIGHTS_NOT_STORED");
  ASSERT_TRUE(store_->PutWeights(bound, {"tiles", 1}, ArraysOf("many")).ok());
  EXPECT_EQ(TextOf(store_->Weights(bound)->arrays), "many");
}

// Nothing of a damaged catalogue is taken for true: it is refused, or what is
// wrong is named.
TEST_F(SqliteStoreTest, NeverServesADamagedCatalogue) {
  PoseAppend pose = Whole(Key("live"), 1, 1);
  ASSERT_TRUE(store_->Append(pose, nullptr).ok());
  store_.reset();
  const std::string right = disk_.Contents(kCatalogue);
  int refused = 0;
  int named = 0;
  for (size_t at = 0; at < right.size(); at += 37) {
    disk_.Replace(kCatalogue, Flipped(right, at));
    const auto store = Open(On(disk_));
    if (!store.ok()) {
      ++refused;
      continue;
    }
    const StoreContents contents = *(*store)->Load();
    named += static_cast<int>(contents.damaged.size());
    for (const StoredModel& model : contents.models) {
      EXPECT_EQ(model.display_name, "the model") << "byte " << at;
    }
    for (const StoredBinding& binding : contents.bindings) {
      EXPECT_EQ(binding.request, "request of bound") << "byte " << at;
    }
    for (const StoredSession& session : contents.sessions) {
      EXPECT_EQ(session.resume_token_hash, "hash of live") << "byte " << at;
      const auto found = (*store)->LoadSession(session.key);
      if (!found.ok()) continue;
      EXPECT_EQ(found->pose.vertices, pose.positions) << "byte " << at;
    }
  }
  EXPECT_GT(refused, 0);
  EXPECT_GT(named, 0);
}

TEST_F(SqliteStoreTest, CollectsWhatACrashLeft) {
  for (const char* name :
       {"models/ann/lost", "models/ann/half~", "weights/ann/bound.tiles-9"}) {
    disk_.MakeDirectory("/data/weights/ann");
    ASSERT_GT(
        disk_.Open(absl::StrCat("/data/", name), FileSystem::Access::kCreate),
        0);
  }
  EXPECT_EQ(*store_->CollectOrphans(), 3);
  EXPECT_EQ(TextOf(*store_->ModelArrays(Key("model"))), "mesh");
}

TEST_F(SqliteStoreTest, GoesOnOnceAFullDiskHasRoom) {
  const StoreKey live = Key("live");
  ASSERT_TRUE(store_->Append(Whole(live, 1, 1), nullptr).ok());
  ASSERT_TRUE(store_->Sync().ok());
  disk_.Inject({.error = ENOSPC});
  absl::Status told;
  ASSERT_TRUE(store_
                  ->Append(Part(live, 2, 0, 2),
                           [&](const absl::Status& status) { told = status; })
                  .ok());
  EXPECT_EQ(ReasonOf(store_->Sync()), "DISK_FULL");
  EXPECT_EQ(ReasonOf(told), "DISK_FULL");
  EXPECT_EQ(store_->DurableRevision(live), 1u);
  EXPECT_EQ(ReasonOf(store_->Append(Part(live, 3, 0, 3), nullptr)),
            "REVISION_GAP");
  ASSERT_TRUE(store_->Append(Whole(live, 3, 3), nullptr).ok());
  ASSERT_TRUE(store_->Sync().ok());
  EXPECT_EQ(store_->DurableRevision(live), 3u);
}

// The log grows until it is folded into the file, which a commit does that went
// well.
TEST_F(SqliteStoreTest, FoldsTheLogThatHasFilledTheDisk) {
  disk_.SetSize(disk_.Used() + 100'000);
  const StoreKey live = Key("live");
  uint64_t revision = 0;
  absl::Status status;
  while (status.ok()) {
    ASSERT_LT(revision, 10'000u);
    ++revision;
    ASSERT_TRUE(store_->Append(Whole(live, revision, 1, 100), nullptr).ok());
    status = store_->Sync();
  }
  EXPECT_EQ(ReasonOf(status), "DISK_FULL");
  // So there is room for the next, and to remove something.
  ++revision;
  ASSERT_TRUE(store_->Append(Whole(live, revision, 2, 100), nullptr).ok());
  EXPECT_TRUE(store_->Sync().ok());
  EXPECT_EQ(store_->DurableRevision(live), revision);
  EXPECT_TRUE(store_->DeleteSession(live).ok());
}

TEST_F(SqliteStoreTest, StartsOnADiskThatTheLogHasFilled) {
  const StoreKey live = Key("live");
  for (uint64_t revision = 1; revision <= 20; ++revision) {
    ASSERT_TRUE(store_->Append(Whole(live, revision, 1, 100), nullptr).ok());
    ASSERT_TRUE(store_->Sync().ok());
    // From then on all is in the log, and nothing new for the file.
    if (revision == 3) {
      store_.reset();
      store_ = MustOpen(On(disk_));
    }
  }
  disk_.EndProcess();
  store_.reset();
  disk_.SetSize(disk_.Used());
  store_ = MustOpen(On(disk_));
  const std::vector<StoreKey> taken = {live};
  EXPECT_TRUE(store_->TakeOver(taken).ok());
}

TEST_F(SqliteStoreTest, TakesNoMorePosesThanMayWait) {
  store_.reset();
  StoreOptions options = On(disk_);
  options.max_waiting_bytes = 10;
  store_ = MustOpen(options);
  const absl::Status status = store_->Append(Whole(Key("live"), 1, 1), nullptr);
  EXPECT_EQ(ReasonOf(status), "JOURNAL_BEHIND");
  EXPECT_THAT(status.message(), HasSubstr("wait for the disk, of 10 that may"));
}

TEST_F(SqliteStoreTest, SaysWhoHasTheDirectory) {
  const absl::Status status = Open(On(disk_)).status();
  EXPECT_EQ(ReasonOf(status), "DIRECTORY_IN_USE");
  EXPECT_THAT(status.message(),
              HasSubstr(absl::StrCat("/data is used by process ", getpid())));
}

TEST(SqliteStore, SaysWhoHasTheDirectoryOfTheMachine) {
  StoreOptions options;
  options.directory = Temporary().Path("in_use");
  const auto store = MustOpen(options);
  EXPECT_THAT(Open(options).status().message(),
              HasSubstr(absl::StrCat("is used by process ", getpid())));
}

TEST_F(SqliteStoreTest, BringsAnOlderFormatUpToDate) {
  store_.reset();
  const std::vector<const char*> upgrades = {
      StoreUpgrades()[0], "ALTER TABLE models ADD COLUMN note TEXT",
      "UPDATE models SET note = 'upgraded'"};
  {
    const auto newer = StoreDatabase::Open(kCatalogue, disk_.vfs(), upgrades);
    ASSERT_TRUE(newer.ok()) << newer.status();
    EXPECT_EQ((*newer)->Load()->sessions.size(), 1u);
  }
  {
    const auto database = Database::Open(kCatalogue, disk_.vfs());
    EXPECT_EQ(*(*database)->Number("PRAGMA user_version"), 3);
    EXPECT_EQ(*(*database)->Number(
                  "SELECT count(*) FROM models WHERE note = 'upgraded'"),
              1);
  }
  const absl::Status status = Open(On(disk_)).status();
  EXPECT_EQ(ReasonOf(status), "FORMAT_TOO_NEW");
  EXPECT_THAT(status.message(),
              HasSubstr("has format 3; this version of deformd knows 1"));
}

TEST_F(SqliteStoreTest, AnUpgradeThatFailsChangesNothing) {
  store_.reset();
  const std::vector<const char*> upgrades = {
      StoreUpgrades()[0], "ALTER TABLE models ADD COLUMN note TEXT",
      "UPDATE nothing SET note = 'upgraded'"};
  EXPECT_FALSE(StoreDatabase::Open(kCatalogue, disk_.vfs(), upgrades).ok());
  EXPECT_EQ(MustOpen(On(disk_))->Load()->models.size(), 1u);
}

TEST(SqliteStore, RefusesTheFilesOfOthers) {
  SimulatedDisk disk;
  ASSERT_EQ(disk.MakeDirectory("/data"), 0);
  {
    const auto other = Database::Open(kCatalogue, disk.vfs());
    ASSERT_TRUE((*other)->Execute("CREATE TABLE songs(title)").ok());
  }
  const absl::Status status = Open(On(disk)).status();
  EXPECT_EQ(ReasonOf(status), "NOT_A_STORE");
  EXPECT_THAT(status.message(), HasSubstr("was not made by deformd"));
  ASSERT_GT(disk.Open("/text", FileSystem::Access::kCreate), 0);
  disk.Replace(kCatalogue, std::string(8192, 'x'));
  EXPECT_EQ(ReasonOf(Open(On(disk)).status()), "CATALOGUE_DAMAGED");
}

TEST_F(SqliteStoreTest, BacksUpWhileOthersWriteAndComesBack) {
  ASSERT_TRUE(
      store_->PutWeights(Key("bound"), {"tiles", 1}, ArraysOf("many")).ok());
  ASSERT_TRUE(store_->Append(Whole(Key("live"), 1, 1), nullptr).ok());
  ASSERT_TRUE(store_->Sync().ok());
  std::thread writer([this] {
    for (uint64_t revision = 2; revision < 200; ++revision) {
      const double value = static_cast<double>(revision);
      EXPECT_TRUE(
          store_->Append(Whole(Key("live"), revision, value), nullptr).ok());
      if (revision % 20 == 0) {
        EXPECT_TRUE(
            store_->PutModel(ModelOf(Key("more")), ArraysOf("more")).ok());
        EXPECT_TRUE(store_->DeleteModel(Key("more")).ok());
      }
    }
  });
  const absl::Status backed_up = store_->Backup("/backup");
  writer.join();
  ASSERT_TRUE(backed_up.ok()) << backed_up;
  ASSERT_TRUE(store_->DeleteModel(Key("model")).ok());

  ASSERT_TRUE(RestoreBackup(disk_, disk_.vfs(), "/backup", "/again").ok());
  const auto again = MustOpen(On(disk_, "/again"));
  EXPECT_EQ(TextOf(*again->ModelArrays(Key("model"))), "mesh");
  EXPECT_EQ(TextOf(again->Weights(Key("bound"))->arrays), "many");
  const SessionPose pose = *again->LoadSession(Key("live"));
  EXPECT_GE(pose.revision, 1u);
  EXPECT_EQ(pose.pose.vertices(0, 0), static_cast<double>(pose.revision));
  const StoreContents contents = *again->Load();
  for (const StoredModel& model : contents.models) {
    EXPECT_TRUE(again->ModelArrays(model.key).ok()) << model.key.id;
  }
}

TEST_F(SqliteStoreTest, CopiesOverNothing) {
  ASSERT_TRUE(store_->Backup("/backup").ok());
  EXPECT_EQ(ReasonOf(store_->Backup("/backup")), "DIRECTORY_EXISTS");
  EXPECT_EQ(
      ReasonOf(RestoreBackup(disk_, disk_.vfs(), "/backup", "/data").status()),
      "DIRECTORY_EXISTS");
}

TEST_F(SqliteStoreTest, RestoresNothingThatIsDamaged) {
  ASSERT_TRUE(store_->Backup("/backup").ok());
  Damage("/backup/models/ann/model");
  const absl::Status status =
      RestoreBackup(disk_, disk_.vfs(), "/backup", "/again").status();
  EXPECT_EQ(ReasonOf(status), "FILE_DAMAGED");
  EXPECT_THAT(status.message(), HasSubstr("/backup/models/ann/model"));
  for (const std::string& file : disk_.Files()) {
    EXPECT_FALSE(absl::StartsWith(file, "/again/")) << file;
  }
  // What is left of it is named to who tries again.
  const absl::Status again =
      RestoreBackup(disk_, disk_.vfs(), "/backup", "/again").status();
  EXPECT_EQ(ReasonOf(again), "DIRECTORY_EXISTS");
  EXPECT_THAT(again.message(), HasSubstr("/again.partial is there, left of a"));
  EXPECT_THAT(again.message(), HasSubstr("remove it"));
}

TEST_F(SqliteStoreTest, RestoresAllButWeightsThatAreDamaged) {
  ASSERT_TRUE(
      store_->PutWeights(Key("bound"), {"tiles", 1}, ArraysOf("many")).ok());
  ASSERT_TRUE(store_->Backup("/backup").ok());
  const std::string weights = "/backup/weights/ann/bound.tiles-1";
  Damage(weights);
  EXPECT_EQ(RestoreBackup(disk_, disk_.vfs(), "/backup", "/again").value(),
            std::vector<std::string>{weights});
  const auto again = MustOpen(On(disk_, "/again"));
  EXPECT_EQ(TextOf(*again->ModelArrays(Key("model"))), "mesh");
  // They are to be computed again.
  EXPECT_FALSE(again->Weights(Key("bound")).ok());
  EXPECT_EQ(again->Load()->bindings.size(), store_->Load()->bindings.size());
}

TEST_F(SqliteStoreTest, ABackupThatFailedIsNotTakenForOne) {
  for (int64_t at = 0; at < 20; ++at) {
    const std::string target = absl::StrCat("/backup", at);
    disk_.Inject({.at = at, .error = EIO});
    if (store_->Backup(target).ok()) continue;
    EXPECT_EQ(
        RestoreBackup(disk_, disk_.vfs(), target, absl::StrCat("/again", at))
            .status()
            .code(),
        absl::StatusCode::kNotFound)
        << "call " << at;
  }
}

}  // namespace
}  // namespace deform::server
