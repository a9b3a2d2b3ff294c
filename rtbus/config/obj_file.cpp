/// The reader of Wavefront OBJ files, declared in body_shape.hpp.
#include <charconv>
#include <cmath>
#include <fstream>

#include "rtbus/config/body_shape.hpp"

namespace rtbus::config {
namespace {

constexpr std::size_t kMaxVertices = 1'000'000;
constexpr std::size_t kMaxTriangles = 2'000'000;
constexpr double kMaxCoordinate_m = 1000.0;  // as of bodies[].position_m

/// Takes the next word off the front of `line`; empty at its end.
std::string_view next_word(std::string_view& line) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t begin = std::min(line.find_first_not_of(kBlank), line.size());
  const std::size_t end = std::min(line.find_first_of(kBlank, begin), line.size());
  const std::string_view word = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return word;
}

class ObjReader {
 public:
  ObjReader(std::string file, double metres_per_unit) : metres_per_unit_(metres_per_unit) {
    mesh_.file = std::move(file);
  }

  void read_line(std::string_view line) {
    ++number_;
    const std::string_view kind = next_word(line);
    if (kind == "v") read_vertex(line);
    if (kind == "f") read_face(line);
  }

  TriangleMesh finish() {
    if (mesh_.vertices_m.size() < 4) fail_file("has fewer than four vertices (lines that begin with v)");
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail_file(const std::string& problem) const { throw Error(mesh_.file + ": " + problem); }
  [[noreturn]] void fail(const std::string& problem) const {
    throw Error(mesh_.file + ":" + std::to_string(number_) + ": " + problem);
  }

  void read_vertex(std::string_view line) {
    Eigen::Vector3d vertex;
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view word = next_word(line);
      double value = 0.0;
      const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
      if (error != std::errc{} || end != word.data() + word.size()) fail("a vertex needs three numbers");
      vertex[axis] = value * metres_per_unit_;
    }
    if (!vertex.allFinite() || vertex.cwiseAbs().maxCoeff() > kMaxCoordinate_m) {
      fail("a vertex lies farther than 1000 m from the origin; is metres_per_unit right?");
    }
    if (mesh_.vertices_m.size() == kMaxVertices) fail("more than 1000000 vertices");
    mesh_.vertices_m.push_back(vertex);
  }

  /// `f 1 2 3`, `f 1/1/1 2/2/2 3/3/3 4/4/4`, `f -3 -2 -1`: a polygon becomes a fan around its first corner.
  void read_face(std::string_view line) {
    std::array<std::uint32_t, 3> corners{};
    std::size_t count = 0;
    for (std::string_view word = next_word(line); !word.empty(); word = next_word(line), ++count) {
      const std::uint32_t corner = read_corner(word.substr(0, word.find('/')));
      if (count < 2) {
        corners[count] = corner;
        continue;
      }
      if (mesh_.triangles.size() == kMaxTriangles) fail("more than 2000000 triangles");
      mesh_.triangles.push_back({corners[0], corners[1], corner});
      mesh_.lines.push_back(static_cast<std::uint32_t>(number_));
      corners[1] = corner;
    }
    if (count < 3) fail("a face needs three corners or more");
  }

  std::uint32_t read_corner(std::string_view word) const {
    long long index = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), index);
    if (error != std::errc{} || end != word.data() + word.size()) fail("a corner of a face is not a number");
    const auto known = static_cast<long long>(mesh_.vertices_m.size());
    const long long from_zero = index < 0 ? known + index : index - 1;
    if (from_zero < 0 || from_zero >= known)
      fail("a face names vertex " + std::to_string(index) + ", which is not there");
    return static_cast<std::uint32_t>(from_zero);
  }

  TriangleMesh mesh_;
  double metres_per_unit_;
  std::size_t number_ = 0;
};

}  // namespace

TriangleMesh read_obj(const std::string& file, double metres_per_unit) {
  std::ifstream stream(file);
  if (!stream) throw Error(file + ": cannot be read");
  ObjReader reader(file, metres_per_unit);
  for (std::string line; std::getline(stream, line);) reader.read_line(line);
  return reader.finish();
}

}  // namespace rtbus::config
