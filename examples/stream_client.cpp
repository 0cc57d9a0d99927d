// A stream estimator in C++ that never moves: c++ -O2 -std=c++17 -o run stream_client.cpp
// Put your own odometry where `pose` is made; docs/estimators.md has every field. Little-endian machines only.
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

struct Frame {
  int64_t index, t_ns;
  uint32_t width, height, channels, pictures, imu_readings, encoder_readings;
};
static_assert(sizeof(Frame) == 40, "the fields follow each other without a gap");

static bool read_all(void* to, size_t bytes) { return std::fread(to, 1, bytes, stdin) == bytes; }

static void send(const char* tag, const std::string& payload) {
  const uint32_t length = static_cast<uint32_t>(payload.size());
  std::fwrite(tag, 1, 4, stdout);
  std::fwrite(&length, 4, 1, stdout);
  std::fwrite(payload.data(), 1, payload.size(), stdout);
  std::fflush(stdout);
}

template <typename T>
static void append(std::string& payload, const T& value) {
  payload.append(reinterpret_cast<const char*>(&value), sizeof value);
}

int main() {
  char tag[5] = {};
  uint32_t length = 0;
  std::vector<unsigned char> payload;
  while (read_all(tag, 4) && read_all(&length, 4)) {
    payload.resize(length);
    if (!read_all(payload.data(), length)) return 2;  // torn
    if (!std::strcmp(tag, "CALB")) {
      std::fprintf(stderr, "calibration: %.*s\n", int(length), reinterpret_cast<char*>(payload.data()));
      send("REDY", "");
    } else if (!std::strcmp(tag, "FRAM")) {
      Frame frame;
      std::memcpy(&frame, payload.data(), sizeof frame);
      const unsigned char* left = payload.data() + sizeof frame;                              // row by row
      const unsigned char* right = left + size_t(frame.width) * frame.height * frame.channels;  // where pictures == 2
      (void)left, (void)right;
      const double pose[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};  // T_odom_left: the first three rows
      std::string answer;
      append(answer, frame.index);
      append(answer, uint32_t(1));  // 0 init, 1 ok, 2 stationary, 3 degraded, 4 lost
      append(answer, uint32_t(1));  // 1: a pose follows, 2: a covariance
      append(answer, pose);
      send("POSE", answer);
    } else if (!std::strcmp(tag, "DONE")) {
      send("DONE", "");
      return 0;
    }
  }
  return 2;
}
