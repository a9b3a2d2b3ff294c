#pragma once
/// @file writer.hpp
/// A recording: every sample of chosen topics in one HDF5 file, a dataset per field, readable by h5py, MATLAB and
/// h5dump. docs/recording.md draws the file.
///
/// Written in HDF5's single-writer/multiple-reader mode: what was flushed survives kill −9 of the recorder, and others
/// may read while it grows. One thread; nothing here is for the realtime context.
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "rtbus/result.hpp"
#include "rtbus/segment.hpp"

namespace rtbus::recording {

inline constexpr char kSchema[] = "rtbus-recording/1";

/// Why a recording could not be written or read.
struct Fault {
  std::string message;  ///< What failed and what to do about it.
};

/// A text file of the set-up, kept inside the recording.
struct ConfigFile {
  std::string path;
  std::string text;
};

/// Free space below which a recording ends by itself, so that the file is closed in order before the disk is full
/// [byte].
inline constexpr std::uint64_t kReserveBytes = 16u << 20;

/// What the file says about itself, and how it is written.
struct Metadata {
  std::string session;
  std::string version;                  ///< Of this project.
  std::string machine;                  ///< Free text: CPU, kernel.
  std::vector<std::string> commands;    ///< Command lines of the nodes.
  std::vector<ConfigFile> config;       ///< Files that they were started with, as they are now.
  std::vector<std::string> body_names;  ///< In the order of physics.body_poses.
  int compression = 0;                  ///< Deflate level 0…9.
  std::uint64_t reserve_bytes = kReserveBytes;
};

/// Writes one recording. Samples are collected in memory and written by flush().
class Writer {
 public:
  /// Creates `path`; refuses to overwrite.
  [[nodiscard]] static Result<Writer, Fault> create(const std::string& path, Metadata metadata);

  Writer(Writer&&) noexcept;
  Writer& operator=(Writer&&) noexcept;
  ~Writer();  ///< Closes, and swallows what goes wrong then: call close() to hear of it.

  /// Another topic. Its handle counts from 0 in the order of calls. A name that is there already (the topic came back
  /// with other fields) is kept apart as NAME~2.
  [[nodiscard]] Result<std::size_t, Fault> add_topic(const std::string& name, const Segment::Description& description);

  /// Takes a sample in memory; flush() writes it. `bytes` is as long as the description said.
  void append(std::size_t topic, std::uint64_t sequence, std::uint64_t stamp_ns, std::span<const std::byte> bytes);

  /// Samples that the recorder lost on this topic since the start [count].
  void set_dropped(std::size_t topic, std::uint64_t count);

  /// Notes an event; longer text is cut to 255 bytes.
  void mark(std::uint64_t stamp_ns, const std::string& text);

  /// Writes what was appended and hands it to the operating system: from here on it survives this process.
  [[nodiscard]] Result<void, Fault> flush();

  /// Flushes, closes, and notes that the recording is complete. Idempotent.
  [[nodiscard]] Result<void, Fault> close();

  [[nodiscard]] std::uint64_t rows(std::size_t topic) const noexcept;  ///< Written and waiting.
  [[nodiscard]] std::uint64_t pending_bytes() const noexcept;          ///< Waiting in memory.
  [[nodiscard]] std::uint64_t file_bytes() const noexcept;             ///< On disk now.

 private:
  struct Impl;
  explicit Writer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace rtbus::recording
