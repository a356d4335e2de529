// Models and bindings that outlive their server.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "server/models/binding_bytes.h"
#include "server/stores/bytes.h"
#include "tests/server/models/stored_life.h"

namespace deform::server {
namespace {

using Kind = SimulatedDisk::Fault::Kind;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

Mesh Ball() { return MeshOf(Icosphere(0.5, 1)); }

std::vector<float> WeightsOf(const Binding& binding) {
  std::vector<float> weights(binding.point_count() * binding.column_count());
  binding.CopyWeights(0, binding.point_count(), weights.data());
  return weights;
}

// A cage with points outside of it.
BindSpec WithExits(const std::string& model_id) {
  BindSpec spec = InCube(model_id, 0.4);
  spec.exits = {.kind = ExitRegions::Kind::kPerPoint,
                .face_of_point = std::vector<int32_t>(
                    static_cast<size_t>(Ball().size()), 0)};
  return spec;
}

// All of which stay unbound.
BindSpec WithoutExits(const std::string& model_id) {
  BindSpec spec = InCube(model_id, 0.4);
  spec.unbindable = Unbindable::kReport;
  spec.clamped = {3, 5};
  return spec;
}

BindSpec OfHandles(const std::string& model_id) {
  const Positions corners =
      CageOf(Cuboid(Vec3::Constant(-1), Vec3::Constant(1))).vertices();
  return {
      .tenant = "t",
      .model_id = model_id,
      .rig =
          Handles::Create(3, corners.topRows(5), corners.bottomRows(3)).value(),
      .scheme = "t_cc",
      .options = {.handle_weights = {0, 0.1, 0.2, 0, 0}}};
}

std::string BytesOf(const BindingRecord& record) {
  return EncodeRequest(record.facts.request(), record.weight_tolerance) +
         EncodeFacts(record.facts);
}

TEST(StoredModels, AreTheSameInTheNextLife) {
  SimulatedDisk disk;
  std::string id;
  absl::Time created;
  {
    Life life(disk);
    id = life.Register(Ball()).value();
    created = life.models().catalogue().Find("t", id).value()->create_time;
  }
  Life life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  const auto record = life.models().catalogue().Find("t", id).value();
  EXPECT_EQ(record->display_name, "a name");
  EXPECT_EQ(record->create_time, created);
  EXPECT_EQ(record->mesh->positions(), Ball().positions());
  EXPECT_EQ(record->mesh->faces(), Ball().faces());
  EXPECT_EQ(life.Register(Ball()).value(), id);
}

TEST(StoredModels, KeepTheirDimension) {
  SimulatedDisk disk;
  Positions square(4, 3);
  square << 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0;
  std::string id;
  {
    Life life(disk);
    id = life.Register(Mesh::Create(2, square, Faces(0, 3)).value()).value();
  }
  Life life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  const auto record = life.models().catalogue().Find("t", id).value();
  EXPECT_EQ(record->mesh->dimension(), 2);
  EXPECT_EQ(record->mesh->positions(), square);
}

TEST(StoredModels, AreGoneWhenTheyWereRemoved) {
  SimulatedDisk disk;
  std::string id;
  {
    Life life(disk);
    id = life.Register(Ball()).value();
    EXPECT_TRUE(life.models().Remove("t", id).ok());
  }
  Life life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  EXPECT_EQ(life.models().catalogue().size(), 0);
}

TEST(StoredModels, StayWhenTheStoreCannotRemoveThem) {
  SimulatedDisk disk;
  Life life(disk);
  const std::string id = life.Register(Ball()).value();
  disk.Inject({.kind = Kind::kError, .at = 0, .error = EIO});
  EXPECT_EQ(DetailOf(life.models().Remove("t", id)).reason, "STORE_FAILED");
  EXPECT_TRUE(life.models().catalogue().Find("t", id).ok());
  EXPECT_TRUE(life.models().Remove("t", id).ok());
}

TEST(StoredModels, BeyondTheLimitsAreNotLeftOutSilently) {
  SimulatedDisk disk;
  {
    Life life(disk);
    EXPECT_TRUE(life.Register(Ball()).ok());
    EXPECT_TRUE(life.Register(MeshOf(Icosphere(0.6, 1))).ok());
  }
  const absl::Status few = Life(disk, {.models = 1}).Load().status();
  EXPECT_EQ(DetailOf(few).reason, "TOO_MANY_MODELS");
  EXPECT_THAT(std::string(few.message()), HasSubstr("max-models"));
  const absl::Status small = Life(disk, {.model_memory = 100}).Load().status();
  EXPECT_THAT(std::string(small.message()), HasSubstr("max-models-memory"));
  EXPECT_THAT(Life(disk).Load().value(), IsEmpty());
}

TEST(StoredModels, ThatAreRefusedForTheirNumberAreNotStored) {
  SimulatedDisk disk;
  Life life(disk, {.models = 1});
  EXPECT_TRUE(life.Register(Ball()).ok());
  EXPECT_EQ(DetailOf(life.Register(MeshOf(Icosphere(0.6, 1))).status()).reason,
            "TOO_MANY_MODELS");
  EXPECT_EQ(life.store().Load().value().models.size(), 1u);
}

TEST(StoredModels, ThatAreDamagedAreLostUntilTheyAreRegisteredAgain) {
  SimulatedDisk disk;
  std::string model;
  std::string binding;
  {
    Life life(disk);
    model = life.Register(Ball()).value();
    binding = life.Create(InCube(model)).value().record->id;
  }
  const std::string file = "/data/models/t/" + model;
  std::string damaged = disk.Contents(file);
  damaged[100] ^= 1;
  disk.Replace(file, damaged);
  {
    Life life(disk);
    const Losses losses = life.Load().value();
    ASSERT_EQ(losses.size(), 2u);
    EXPECT_THAT(std::string(losses[0].message()),
                HasSubstr("is damaged: register it again"));
    const absl::Status lost =
        life.models().catalogue().Find("t", model).status();
    EXPECT_EQ(lost.code(), absl::StatusCode::kDataLoss);
    EXPECT_EQ(DetailOf(lost).reason, "MODEL_DAMAGED");
    EXPECT_EQ(DetailOf(life.bindings().catalogue().Find("t", binding).status())
                  .reason,
              "BINDING_DAMAGED");
    EXPECT_EQ(life.Register(Ball()).value(), model);
    EXPECT_EQ(life.Create(InCube(model)).value().record->id, binding);
  }
  EXPECT_THAT(Life(disk).Load().value(), IsEmpty());
}

TEST(StoredModels, ThatAreDamagedCanBeRemoved) {
  SimulatedDisk disk;
  std::string model;
  {
    Life life(disk);
    model = life.Register(Ball()).value();
  }
  disk.Replace("/data/models/t/" + model, "cut");
  Life life(disk);
  EXPECT_EQ(life.Load().value().size(), 1u);
  EXPECT_TRUE(life.models().Remove("t", model).ok());
  EXPECT_EQ(
      DetailOf(life.models().catalogue().Find("t", model).status()).reason,
      "MODEL_NOT_FOUND");
}

TEST(StoredBindings, AreTheSameInTheNextLife) {
  SimulatedDisk disk;
  std::vector<std::pair<std::string, std::string>> bytes;
  {
    Life life(disk);
    const std::string model = life.Register(Ball()).value();
    for (BindSpec spec : {InCube(model), WithExits(model), WithoutExits(model),
                          OfHandles(model)}) {
      spec.weight_tolerance = bytes.empty() ? 1e-4 : 0;
      const auto created = life.Create(std::move(spec)).value();
      bytes.emplace_back(created.record->id, BytesOf(*created.record));
    }
    EXPECT_FALSE(life.Find(bytes[1].first)->facts.exit_parts().empty());
    EXPECT_GT(life.Find(bytes[2].first)->facts.unbound_count(), 0);
  }
  Life life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  for (const auto& [id, expected] : bytes) {
    EXPECT_EQ(BytesOf(*life.Find(id)), expected);
    const auto weights = life.Find(id)->weights->state();
    EXPECT_FALSE(weights.resident);
    EXPECT_GE(weights.last_use, life.Find(id)->create_time);
  }
  const auto model_id = life.Find(bytes[0].first)->model_id;
  EXPECT_EQ(DetailOf(life.models().Remove("t", model_id)).reason,
            "MODEL_IN_USE");
}

TEST(StoredBindings, HaveTheirIdAgainWhenTheyAreAskedFor) {
  SimulatedDisk disk;
  std::string id;
  std::string model;
  {
    Life life(disk);
    model = life.Register(Ball()).value();
    id = life.Create(OfHandles(model)).value().record->id;
    life.RunAll();
  }
  Life life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  const CreatedBinding again = life.Create(OfHandles(model)).value();
  EXPECT_EQ(again.record->id, id);
  EXPECT_TRUE(again.existed);
  EXPECT_EQ(life.computed, 0);
}

TEST(StoredBindings, AreGoneWhenTheyWereRemoved) {
  SimulatedDisk disk;
  {
    Life life(disk);
    const std::string model = life.Register(Ball()).value();
    const std::string id = life.Create(InCube(model)).value().record->id;
    life.RunAll();
    EXPECT_TRUE(life.bindings().Remove("t", id).ok());
  }
  Life life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  EXPECT_EQ(life.bindings().catalogue().size(), 0);
  for (const std::string& file : disk.Files()) {
    EXPECT_FALSE(absl::StartsWith(file, "/data/weights/t/")) << file;
  }
}

TEST(StoredBindings, ThatAreRefusedByTheDiskAreNotThere) {
  SimulatedDisk disk;
  Life life(disk);
  const std::string model = life.Register(Ball()).value();
  disk.Inject({.kind = Kind::kError, .at = 0, .error = ENOSPC});
  const absl::Status full = life.Create(InCube(model)).status();
  EXPECT_EQ(full.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(DetailOf(full).reason, "DISK_FULL");
  EXPECT_EQ(life.bindings().catalogue().size(), 0);
  EXPECT_EQ(life.bindings().budget().used(), 0);
  EXPECT_TRUE(life.models().Remove("t", model).ok()) << "it is still in use";
}

class StoredWeights : public testing::TestWithParam<double> {};

TEST_P(StoredWeights, AreReadInTheNextLifeNotComputed) {
  SimulatedDisk disk;
  std::string id;
  std::vector<float> weights;
  {
    Life life(disk);
    BindSpec spec = InCube(life.Register(MeshOf(Icosphere(0.5, 4))).value());
    spec.weight_tolerance = GetParam();
    id = life.Create(std::move(spec)).value().record->id;
    life.RunAll();
    const auto kept = life.Find(id)->weights->Get();
    EXPECT_EQ(kept->compressed() != nullptr, GetParam() > 0);
    weights = WeightsOf(*kept);
  }
  Life life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  const BindingInUse use = life.bindings().Use("t", id, "a test").value();
  EXPECT_EQ(life.computed, 0);
  EXPECT_EQ(WeightsOf(*use.binding), weights);
  const auto state = life.Find(id)->weights->state();
  EXPECT_EQ(state.compressed, GetParam() > 0);
  EXPECT_EQ(state.bytes, use.binding->weight_bytes());
  life.RunAll();
  EXPECT_THAT(life.reported.all(), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(InBothForms, StoredWeights, testing::Values(0, 1e-3));

TEST(StoredBindings, ComputeDamagedWeightsAgainAndKeepThem) {
  SimulatedDisk disk;
  std::string id;
  std::vector<float> weights;
  {
    Life life(disk);
    const auto created =
        life.Create(OfHandles(life.Register(Ball()).value())).value();
    id = created.record->id;
    weights = WeightsOf(*created.binding);
    life.RunAll();
  }
  const std::string file = "/data/weights/t/" + id + ".dense-1";
  std::string damaged = disk.Contents(file);
  damaged[damaged.size() / 3] ^= 64;
  disk.Replace(file, damaged);
  {
    Life life(disk);
    EXPECT_THAT(life.Load().value(), IsEmpty());
    const BindingInUse use = life.bindings().Use("t", id, "a test").value();
    EXPECT_EQ(life.computed, 1);
    EXPECT_EQ(WeightsOf(*use.binding), weights);
    ASSERT_EQ(life.reported.all().size(), 1u);
    EXPECT_THAT(std::string(life.reported.all()[0].message()),
                HasSubstr("are computed again"));
    life.RunAll();
  }
  Life life(disk);
  EXPECT_THAT(life.Load().value(), IsEmpty());
  EXPECT_TRUE(life.bindings().Use("t", id, "a test").ok());
  EXPECT_EQ(life.computed, 0);
}

TEST(StoredBindings, ServeFromMemoryWhenTheDiskHasNoRoomForWeights) {
  SimulatedDisk disk;
  Life life(disk);
  const auto created =
      life.Create(InCube(life.Register(Ball()).value())).value();
  disk.Inject({.kind = Kind::kError, .at = 0, .error = ENOSPC});
  life.RunAll();
  ASSERT_EQ(life.reported.all().size(), 1u);
  EXPECT_EQ(DetailOf(life.reported.all()[0]).reason, "DISK_FULL");
  EXPECT_TRUE(life.bindings().Use("t", created.record->id, "a test").ok());
  EXPECT_EQ(life.computed, 1);
}

TEST(StoredBindings, AreReadAgainAfterTheirWeightsWereEvicted) {
  SimulatedDisk disk;
  Life life(disk);
  const std::string id =
      life.Create(InCube(life.Register(Ball()).value())).value().record->id;
  life.RunAll();
  const int64_t all = life.bindings().budget().limit();
  EXPECT_TRUE(life.bindings()
                  .budget()
                  .Reserve(all - life.Find(id)->memory.bytes(), "others need")
                  .ok());
  EXPECT_FALSE(life.Find(id)->weights->state().resident);
  EXPECT_TRUE(life.bindings().Use("t", id, "a test").ok());
  EXPECT_EQ(life.computed, 1);
}

void ExpectClear(const absl::Status& status) {
  if (status.ok()) return;
  EXPECT_EQ(DetailOf(status).reason, "STORE_FAILED");
}

// Every call to the disk fails once, while a model is registered and bound, and
// its weights are kept.
TEST(StoredRegistries, AreWholeWhicheverCallToTheDiskFails) {
  int64_t calls = 0;
  for (int64_t at = 0; at <= calls; ++at) {
    SCOPED_TRACE(absl::StrCat("call ", at));
    SimulatedDisk disk;
    absl::StatusOr<std::string> model;
    std::string bound;
    std::vector<float> weights;
    {
      Life life(disk);
      const int64_t before = disk.calls();
      // In the first round nothing fails, but the calls are counted.
      if (calls > 0) {
        disk.Inject({.kind = Kind::kError, .at = at, .error = EIO});
      }
      model = life.Register(Ball());
      ExpectClear(model.status());
      if (model.ok()) {
        const auto created = life.Create(InCube(*model));
        ExpectClear(created.status());
        if (created.ok()) {
          bound = created->record->id;
          weights = WeightsOf(*created->binding);
        }
      }
      life.RunAll();
      if (calls == 0) calls = disk.calls() - before;
      EXPECT_EQ(life.models().catalogue().size(), model.ok() ? 1 : 0);
      EXPECT_EQ(life.bindings().catalogue().size(), bound.empty() ? 0 : 1);
    }
    disk.EndProcess();
    Life life(disk);
    EXPECT_THAT(life.Load().value(), IsEmpty());
    if (model.ok()) {
      EXPECT_TRUE(life.models().catalogue().Find("t", *model).ok());
    }
    if (!bound.empty()) {
      const auto use = life.bindings().Use("t", bound, "a test").value();
      EXPECT_EQ(WeightsOf(*use.binding), weights);
    }
  }
  EXPECT_GT(calls, 20);
}

TEST(BindingBytes, AreRefusedHoweverTheyAreCut) {
  SimulatedDisk disk;
  Life life(disk);
  const std::string model = life.Register(Ball()).value();
  for (BindSpec spec :
       {WithExits(model), WithoutExits(model), OfHandles(model)}) {
    const auto record = life.Create(std::move(spec)).value().record;
    const std::string request =
        EncodeRequest(record->facts.request(), record->weight_tolerance);
    const std::string facts = EncodeFacts(record->facts);
    for (size_t size = 0; size < request.size(); size += 7) {
      EXPECT_EQ(
          DecodeRequest(AsBytes(request.substr(0, size)), record->facts.model())
              .status()
              .code(),
          absl::StatusCode::kDataLoss);
    }
    for (size_t size = 0; size < facts.size(); size += 7) {
      EXPECT_EQ(
          DecodeFacts(AsBytes(facts.substr(0, size)), record->facts.request())
              .status()
              .code(),
          absl::StatusCode::kDataLoss);
    }
  }
}

}  // namespace
}  // namespace deform::server
