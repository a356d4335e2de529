#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/deform/deformer.h"
#include "core/weights/compress_binding.h"
#include "tests/bench/baselines/baselines.h"
#include "tests/bench/benches.h"
#include "tests/bench/contest.h"
#include "tests/bench/drag.h"
#include "tests/bench/scenes.h"

namespace deform::bench {
namespace {

constexpr int kSteps = 8;           // Of a drag, at a turn: it is a series.
constexpr int64_t kJudged = 2000;   // Points compared with doubles.
constexpr int64_t kSmall = 10'000;  // Points of models that caches hold.

struct Scene {
  std::string name;
  int64_t points;
  Rig rig;
  std::string scheme;
  std::vector<double> tolerances = {};  // To compress to.
  double size = 1;                      // Of the organ: within the cage.
};

std::vector<Scene> Scenes(const Settings& settings) {
  const Cage organ = OrganCage(9, 12), coarse = OrganCage(2, 7);
  const auto points = [&](int64_t count) { return settings.Points(count); };
  std::vector<Scene> scenes = {
      {"173K x 326", points(173'000), organ, "green", {1e-4, 1e-5}},
      {"173K x 100 handles",
       points(173'000),
       HandlesAround(100),
       "s_cc",
       {1e-5}},
      {"100 x 44", 100, coarse, "green", {}, 0.5},
      {"100 x 326", 100, organ, "green"},
  };
  if (settings.quick) return scenes;
  for (Scene& scene : scenes) {
    if (!scene.tolerances.empty()) scene.tolerances = {1e-4, 1e-5, 1e-6};
  }
  scenes.push_back({"173K x 30 handles",
                    points(173'000),
                    HandlesAround(30),
                    "s_cc",
                    {1e-4, 1e-5}});
  scenes.push_back(
      {"543K x 44", points(543'000), coarse, "green", {1e-5}, 0.5});
  scenes.push_back(
      {"1M x 44", points(1'000'000), coarse, "green", {1e-5}, 0.5});
  return scenes;
}

// One scene with all who deform it.
class DeformContest {
 public:
  DeformContest(const Scene& scene, const Settings& settings, ThreadPool& pool,
                const ReadLimit& limit, const AddRow& add)
      : scene_(scene),
        settings_(settings),
        pool_(pool),
        limit_(limit),
        add_(add),
        poses_{Bent(scene.rig, 0), Bent(scene.rig, 1)},
        // A small scene many times: clocks are coarse.
        repeats_(scene.points < kSmall ? 200 : 1) {
    const double begin = WallSeconds();
    binding_ =
        Bind({.model = std::make_shared<const Mesh>(
                  Mesh::Create(3, scene.size * OrganPoints(scene.points), {})
                      .value()),
              .rig = scene.rig,
              .scheme = scene.scheme},
             {.pool = &pool})
            .value();
    ReportOnce("bind, all cores", WallSeconds() - begin, *binding_);
  }

  void Run() {
    AddDense();
    for (const double tolerance : scene_.tolerances) AddCompressed(tolerance);
    for (const int percent : {1, 5, 10, 25}) AddDeltas(percent);
    for (const int k : {1, 2, 4, 8, 16, 32}) AddBatch(k);
    AddOthers();
    contest_.Run(5, settings_.Seconds(5));
    for (const Entry& entry : entries_) Report(entry);
  }

 private:
  // A contestant, and what its row tells besides its time.
  struct Entry {
    std::string name;
    double limit = 0;  // Seconds; 0: none.
    std::function<double()> error;
    int64_t bytes = 0;
    double columns_share = 0;  // Of a delta.
  };

  void Add(Entry entry, std::function<void()> run, int k = 1,
           Contest::Clock clock = Contest::Clock::kCore) {
    contest_.Add(
        entry.name,
        [repeats = repeats_, run = std::move(run)] {
          for (int r = 0; r < repeats; ++r) run();
        },
        static_cast<double>(repeats_) * k, clock);
    entries_.push_back(std::move(entry));
  }
  const Pose& Next() { return poses_[++turn_ % 2]; }
  std::shared_ptr<Deformer> NewDeformer(
      const std::shared_ptr<const Binding>& binding, ThreadPool* pool) {
    return std::make_shared<Deformer>(binding, pool);
  }

  void AddDense() {
    const int64_t bytes = binding_->weights().bytes();
    const bool small = scene_.points < kSmall;
    const auto one = NewDeformer(binding_, nullptr);
    Add({.name = kDense,
         .limit = small ? 0 : static_cast<double>(bytes) / limit_.one_core,
         .error = [this] { return ErrorOf(Deformed()); },
         .bytes = bytes},
        [this, one] { one->MoveTo(Next(), Deformer::Path::kFull); });
    const auto all = NewDeformer(binding_, &pool_);
    Add(
        {.name = "this, dense, all cores",
         .limit = small ? 0 : static_cast<double>(bytes) / limit_.all_cores},
        [this, all] { all->MoveTo(Next(), Deformer::Path::kFull); }, 1,
        Contest::Clock::kWall);
    const auto frame = std::make_shared<std::vector<float>>(scene_.points * 3);
    Add({.name = "positions of a frame, 1 core"}, [this, one, frame] {
      one->CopyRelative(0, scene_.points, Vec3::Zero(), frame->data());
    });
  }

  void AddCompressed(double tolerance) {
    const double begin = WallSeconds();
    const std::shared_ptr<const Binding> compressed =
        CompressBinding(*binding_, &binding_->weights(), tolerance,
                        {.pool = &pool_})
            .value();
    const std::string form = absl::StrFormat("compressed to %.0e", tolerance);
    ReportOnce(absl::StrCat("making it ", form, ", all cores"),
               WallSeconds() - begin, *compressed);
    const int64_t bytes = compressed->compressed()->bytes();
    const auto one = NewDeformer(compressed, nullptr);
    // Of the compression alone: how far from dense weights.
    const auto error = [this, compressed] {
      Deformer dense(binding_, nullptr), deformer(compressed, nullptr);
      dense.MoveTo(poses_[1], Deformer::Path::kFull);
      deformer.MoveTo(poses_[1], Deformer::Path::kFull);
      return LargestDistance(dense.positions(), deformer.positions());
    };
    Add({.name = absl::StrCat("this, ", form, ", 1 core"),
         .limit = static_cast<double>(bytes) / limit_.one_core,
         .error = error,
         .bytes = bytes},
        [this, one] { one->MoveTo(Next(), Deformer::Path::kFull); });
    const auto drag =
        std::make_shared<Drag>(compressed, 0.05, Drag::Kind::kNeighbours);
    Add({.name = absl::StrCat("this, ", form, ", drag of delta 5 %, 1 core")},
        [drag] { drag->Step(); });
  }

  void AddDeltas(int percent) {
    struct Kind {
      const char* name;
      Drag::Kind kind;
    };
    for (const Kind& kind :
         {Kind{"drag of neighbours", Drag::Kind::kNeighbours},
          Kind{"drag of scattered", Drag::Kind::kScattered},
          Kind{"others each time", Drag::Kind::kOthers}}) {
      const auto drag =
          std::make_shared<Drag>(binding_, percent / 100.0, kind.kind);
      const auto all = static_cast<double>(binding_->column_count());
      double& last = delta_columns_[kind.kind];
      // Not the same once more under another name, where vertices are few.
      if (!drag->possible() || drag->columns() > 0.4 * all ||
          drag->columns() == last) {
        continue;
      }
      last = drag->columns();
      Add(
          {.name = absl::StrCat("this, delta ", percent, " %, ", kind.name,
                                " (", drag->columns(), " columns), 1 core"),
           .error = [drag] { return drag->Error(); },
           .columns_share = drag->columns() / all},
          [drag] {
            for (int step = 0; step < kSteps; ++step) drag->Step();
          },
          kSteps);
    }
  }

  void AddBatch(int k) {
    while (std::ssize(sessions_) < k) {
      sessions_.push_back(NewDeformer(binding_, nullptr));
    }
    Add(
        {.name = absl::StrCat("this, K = ", k, ", a session, 1 core")},
        [this, k] {
          const Pose& pose = Next();
          std::vector<DeformJob> jobs;
          for (int s = 0; s < k; ++s) {
            jobs.push_back({.deformer = sessions_[s].get(),
                            .pose = &pose,
                            .path = Deformer::Path::kFull});
          }
          MoveTogether(jobs, nullptr);
        },
        k);
  }

  // Row by row, as others keep them.
  void AddOthers() {
    const int64_t n = binding_->point_count();
    const int64_t columns = binding_->column_count();
    floats_.resize(n * columns);
    for (int64_t i = 0; i < n; ++i) {
      for (int64_t c = 0; c < columns; ++c) {
        floats_[i * columns + c] = binding_->weights().at(i, c);
      }
    }
    doubles_.assign(floats_.begin(), floats_.end());
    PosedColumns(scene_.rig, binding_->scheme().uses_normals())
        .UpdateAll(poses_[1], posed_);
    column_.assign(posed_.data(), posed_.data() + posed_.size());
    out_.resize(n, 3);
    out_double_.resize(n, 3);
    Add({.name = "Eigen float, 1 core"}, [this, n, columns] {
      EigenProduct(floats_.data(), n, columns, column_.data(), out_.data());
    });
    Add({.name = "Eigen double, 1 core"}, [this, n, columns] {
      EigenProduct(doubles_.data(), n, columns, posed_.data(),
                   out_double_.data());
    });
    Add({.name = kPlain,
         .error = [this] { return ErrorOf(out_.cast<double>()); }},
        [this, n, columns] {
          PlainProduct(floats_.data(), n, columns, column_.data(), out_.data());
        });
  }

  Positions Deformed() const {
    Deformer deformer(binding_, nullptr);
    deformer.MoveTo(poses_[1], Deformer::Path::kFull);
    return deformer.positions();
  }
  double LargestDistance(const Positions& a, const Positions& b) const {
    return (a - b).rowwise().norm().maxCoeff() / DiagonalOf(scene_.rig);
  }
  // Of some points: weights and sums in double are right.
  double ErrorOf(const Positions& all) const {
    const int64_t count = std::min(kJudged, binding_->point_count());
    const int64_t first = (binding_->point_count() - count) / 2;
    const WeightBlock right = RecomputeWeights(*binding_, first, count).value();
    Positions expected =
        right.vertex * posed_.topRows(binding_->vertex_count());
    if (binding_->normal_count() > 0) {
      expected += right.normal * posed_.bottomRows(binding_->normal_count());
    }
    return LargestDistance(all.middleRows(first, count), expected);
  }

  static double WallSeconds() {
    return std::chrono::duration<double>(
               std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }
  std::string Name(const std::string& name) const {
    return absl::StrCat("deform ", scene_.name, "/", name);
  }
  void ReportOnce(const std::string& name, double seconds,
                  const Binding& binding) const {
    const CompressedWeights* compressed = binding.compressed();
    add_({.name = Name(name),
          .seconds = seconds,
          .rate = static_cast<double>(scene_.points) / seconds,
          .unit = "points/s",
          .megabytes =
              1e-6 * static_cast<double>(compressed != nullptr
                                             ? compressed->bytes()
                                             : binding.weights().bytes())});
  }
  void Report(const Entry& entry) const {
    const double seconds = contest_.Best(entry.name);
    Row row{.name = Name(entry.name),
            .seconds = seconds,
            .rate = static_cast<double>(scene_.points) / seconds,
            .unit = "points/s"};
    if (!absl::StartsWith(entry.name, "positions")) {
      row.to_naive = contest_.Best(kPlain) / seconds;
    }
    const double limit = entry.columns_share > 0
                             ? entry.columns_share * contest_.Best(kDense)
                             : entry.limit;
    if (limit > 0) row.to_limit = limit / seconds;
    if (entry.error) row.error = entry.error();
    if (entry.bytes > 0)
      row.megabytes = 1e-6 * static_cast<double>(entry.bytes);
    add_(row);
  }

  static constexpr char kDense[] = "this, dense, 1 core";
  static constexpr char kPlain[] = "plain loops, 1 core";

  const Scene& scene_;
  const Settings& settings_;
  ThreadPool& pool_;
  const ReadLimit& limit_;
  const AddRow& add_;
  const Pose poses_[2];
  const int repeats_;
  std::shared_ptr<const Binding> binding_;
  int turn_ = 0;
  std::map<Drag::Kind, double> delta_columns_;  // Of the last.
  std::vector<std::shared_ptr<Deformer>> sessions_;
  std::vector<float> floats_, column_;
  std::vector<double> doubles_;
  Columns posed_;
  Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> out_;
  Positions out_double_;
  Contest contest_;
  std::vector<Entry> entries_;
};

}  // namespace

void MeasureDeforming(const Settings& settings, const ReadLimit& limit,
                      const AddRow& add) {
  ThreadPool pool({});
  for (const Scene& scene : Scenes(settings)) {
    if (!settings.Wants("deform " + scene.name)) continue;
    DeformContest(scene, settings, pool, limit, add).Run();
  }
}

}  // namespace deform::bench
