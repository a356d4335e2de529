// Frames over gRPC beside the same bytes over plain TCP sockets, in one run:
// how much of what the machine's loopback can do arrives, and what it costs the
// sending side.
//
//   stream_bench [RECEIVERS [SECONDS]]     2 receivers, 3 s a round by default
//
// Each round sends, in turn, over TCP; frames of one revision, for which
// receivers ask again and again (sending alone); and frames of poses, one after
// the other, for each of which the server deforms a model with few handles.
// Receivers put frames together, and only read the bytes of TCP.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "client/cpp/client.h"
#include "client/load/load_model.h"
#include "tests/support/child_process.h"

namespace deform::bench {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kRounds = 3;
constexpr int kHandles = 8;
constexpr int kInFlight = 4;

// What a way of sending reached, at its best.
struct Reached {
  double bytes_per_second = 0;
  double cpu_per_byte = 0;  // Seconds of the sending side, in that round.

  void Take(double bytes, double seconds, double cpu) {
    if (bytes / seconds <= bytes_per_second) return;
    bytes_per_second = bytes / seconds;
    cpu_per_byte = cpu / bytes;
  }
};

void Require(bool condition, const char* what) {
  if (condition) return;
  std::fprintf(stderr, "stream_bench: %s\n", what);
  std::exit(1);
}

// The sending side, as a process of its own: tells its port, sends as many
// connections the same bytes over and over until they are closed, and tells the
// CPU seconds that took.
int SendOverTcp(int64_t bytes, int receivers) {
  const int listener = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{.sin_family = AF_INET,
                      .sin_addr = {.s_addr = htonl(INADDR_LOOPBACK)}};
  socklen_t size = sizeof(address);
  auto* const any = reinterpret_cast<sockaddr*>(&address);
  Require(bind(listener, any, size) == 0 && listen(listener, receivers) == 0 &&
              getsockname(listener, any, &size) == 0,
          "no socket");
  std::printf("%d\n", ntohs(address.sin_port));
  std::fflush(stdout);
  const std::vector<char> frame(bytes, 1);
  std::vector<std::thread> senders;
  for (int r = 0; r < receivers; ++r) {
    senders.emplace_back([&, one = accept(listener, nullptr, nullptr)] {
      const int on = 1;
      setsockopt(one, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
      int64_t at = 0;
      while (true) {
        const ssize_t sent =
            send(one, frame.data() + at, bytes - at, MSG_NOSIGNAL);
        if (sent < 0) break;
        at = (at + sent) % bytes;
      }
      close(one);
    });
  }
  for (std::thread& sender : senders) sender.join();
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("%.6f\n", static_cast<double>(usage.ru_utime.tv_sec +
                                            usage.ru_stime.tv_sec) +
                            1e-6 * static_cast<double>(usage.ru_utime.tv_usec +
                                                       usage.ru_stime.tv_usec));
  return 0;
}

int ConnectTo(int port) {
  const int one = socket(AF_INET, SOCK_STREAM, 0);
  const sockaddr_in address{.sin_family = AF_INET,
                            .sin_port = htons(static_cast<uint16_t>(port)),
                            .sin_addr = {.s_addr = htonl(INADDR_LOOPBACK)}};
  Require(connect(one, reinterpret_cast<const sockaddr*>(&address),
                  sizeof(address)) == 0,
          "no connection");
  return one;
}

void MeasureTcp(const std::string& program, int64_t bytes, int receivers,
                double seconds, Reached& reached) {
  ChildProcess sender(
      {program, "--tcp", std::to_string(bytes), std::to_string(receivers)});
  const int port = std::atoi(sender.ReadLine().c_str());
  std::atomic<int64_t> received = 0;
  std::vector<std::thread> threads;
  const auto begin = Clock::now();
  const auto end = begin + std::chrono::duration<double>(seconds);
  for (int r = 0; r < receivers; ++r) {
    threads.emplace_back([&, one = ConnectTo(port)] {
      std::vector<char> frame(bytes);
      while (Clock::now() < end) {
        const ssize_t got = recv(one, frame.data(), bytes, MSG_WAITALL);
        Require(got == bytes, "the sender has gone");
        received += got;
      }
      close(one);
    });
  }
  for (std::thread& thread : threads) thread.join();
  const double passed =
      std::chrono::duration<double>(Clock::now() - begin).count();
  reached.Take(static_cast<double>(received), passed,
               std::atof(sender.ReadLine().c_str()));
}

// A deformd with a session of a model whose frames are that large.
class Stream {
 public:
  Stream(const std::string& folder, int64_t points)
      : server_({folder + "/deformd", "--in-memory", "--listen", "127.0.0.1:0",
                 "--log-level", "warn"}),
        address_(AddressOf(server_.ReadLine())),
        client_(Client::Connect(address_).value()) {
    LoadModel made = MakeLoadModel(points, 0, kHandles, 0);
    made.spec.weight_tolerance = 0;  // Nothing else is to run.
    points_ = made.model.positions.rows();
    made.spec.model_id = client_.RegisterModel(made.model, "").value().model_id;
    const BindingInfo binding = client_.CreateBinding(made.spec).value();
    session_ = client_.CreateSession(binding.binding_id).value().session_id;
    rest_ = made.spec.rig.vertices;
  }

  int64_t frame_bytes() const { return points_ * 3 * int64_t{sizeof(float)}; }

  // With poses or, without, the same frame again and again.
  void Measure(bool poses, int receivers, double seconds, Reached& reached) {
    std::atomic<int64_t> frames = 0;
    std::atomic<bool> stop = false;
    std::vector<std::thread> threads;
    for (int r = 0; r < receivers; ++r) {
      threads.emplace_back([&, sends = poses && r == 0] {
        Receive(sends, !poses, stop, frames);
      });
    }
    // Until all are under way.
    while (frames < 4 * receivers) std::this_thread::yield();
    const int64_t before = frames;
    const double cpu = client_.GetServerStatus().value().cpu_seconds;
    const auto begin = Clock::now();
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
    const int64_t count = frames - before;
    const double passed =
        std::chrono::duration<double>(Clock::now() - begin).count();
    const double spent = client_.GetServerStatus().value().cpu_seconds - cpu;
    stop = true;
    for (std::thread& thread : threads) thread.join();
    reached.Take(static_cast<double>(count * frame_bytes()), passed, spent);
  }

 private:
  static std::string AddressOf(const std::string& line) {
    const size_t at = line.rfind(' ');
    Require(at != std::string::npos, "deformd does not listen");
    return line.substr(at + 1, line.size() - at - 2);
  }
  void Send(DeformStream& stream, int64_t number) const {
    Positions one = rest_.topRows(1);
    one(0, 0) *= 1 + 0.01 * static_cast<double>(number % 10);
    stream.Send({.vertices = {0}, .positions = one}).value();
  }
  // All revisions, one after the other, whose poses come from who sends; or who
  // asks gets the present one again.
  void Receive(bool sends, bool asks, const std::atomic<bool>& stop,
               std::atomic<int64_t>& frames) {
    auto own = Client::Connect(address_, {.own_connection = true}).value();
    DeformStream stream = own.Deform(session_, Delivery::kEvery).value();
    Frame frame;
    int64_t sent = 0;
    for (; sends && sent < kInFlight; ++sent) Send(stream, sent);
    while (!stop && stream.NextFrame(frame).ok()) {
      ++frames;
      if (sends) Send(stream, sent++);
      if (asks) stream.RequestKeyframe().IgnoreError();
    }
    stream.Cancel();
  }

  ChildProcess server_;
  const std::string address_;
  Client client_;
  std::string session_;
  Positions rest_;
  int64_t points_ = 0;
};

void Print(const char* what, const Reached& reached, const Reached& tcp) {
  std::printf("  %-23s %.2f GB/s, %.2f of it; %.3f CPU s/GB, %.2f times\n",
              what, 1e-9 * reached.bytes_per_second,
              reached.bytes_per_second / tcp.bytes_per_second,
              1e9 * reached.cpu_per_byte,
              reached.cpu_per_byte / tcp.cpu_per_byte);
  std::fflush(stdout);
}

void Compare(const std::string& folder, int64_t points, int receivers,
             double seconds) {
  Stream stream(folder, points);
  Reached tcp, same, posed;
  for (int round = 0; round < kRounds; ++round) {
    MeasureTcp(folder + "/stream_bench", stream.frame_bytes(), receivers,
               seconds, tcp);
    stream.Measure(false, receivers, seconds, same);
    stream.Measure(true, receivers, seconds, posed);
  }
  std::printf("%.1f MB to %d receivers: TCP %.2f GB/s, %.3f CPU s/GB\n",
              1e-6 * static_cast<double>(stream.frame_bytes()), receivers,
              1e-9 * tcp.bytes_per_second, 1e9 * tcp.cpu_per_byte);
  Print("frames of one revision", same, tcp);
  Print("frames of poses", posed, tcp);
}

int Main(int count, char** arguments) {
  const std::string program = arguments[0];
  const std::string folder = program.substr(0, program.rfind('/'));
  if (count == 4 && std::string(arguments[1]) == "--tcp") {
    return SendOverTcp(std::atoll(arguments[2]), std::atoi(arguments[3]));
  }
  const int receivers = count > 1 ? std::atoi(arguments[1]) : 2;
  const double seconds = count > 2 ? std::atof(arguments[2]) : 3;
  if (receivers < 1 || !(seconds > 0)) {
    std::fprintf(stderr, "usage: stream_bench [RECEIVERS [SECONDS]]\n");
    return 2;
  }
  for (const int64_t points : {173'000, 1'000'000}) {
    Compare(folder, points, receivers, seconds);
  }
  return 0;
}

}  // namespace
}  // namespace deform::bench

int main(int count, char** arguments) {
  return deform::bench::Main(count, arguments);
}
