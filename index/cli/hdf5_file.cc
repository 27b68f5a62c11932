// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/cli/hdf5_file.h"

#include <array>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <hdf5.h>

#include "descriptor/base/error.h"
#include "descriptor/base/replace_file.h"
#include "index/files/text.h"

namespace pliant::cli {
namespace {

using Shape = std::vector<hsize_t>;

// The system's error, of which HDF5 only tells in words: "... errno = 28, error message = ...".
herr_t NoteSystemError(unsigned /*n*/, const H5E_error2_t* error, void* code) {
  constexpr std::string_view kMark = "errno = ";
  const std::string_view text = error->desc == nullptr ? "" : error->desc;
  if (const std::size_t at = text.find(kMark); at != std::string_view::npos) {
    std::from_chars(text.data() + at + kMark.size(), text.data() + text.size(),
                    *static_cast<int*>(code));
  }
  return 0;
}

std::string LastComplaint() {
  int code = 0;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, NoteSystemError, &code);
  return code == 0 ? "HDF5 failed" : std::generic_category().message(code);
}

// A thing of HDF5, closed with this object.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Handle(hid_t id, Close close) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }  // NOLINT: as HDF5 takes it
  // False: what was still to be written could not be.
  bool CloseNow() { return close_(std::exchange(id_, -1)) >= 0; }

 private:
  hid_t id_;
  const Close close_;
};

// Every D of D x N rows, transposed from N x D.
template <typename Value>
std::vector<Value> Columns(const std::vector<Value>& rows, std::size_t n, std::size_t dim) {
  std::vector<Value> columns(rows.size());
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t d = 0; d < dim; ++d) columns[d * n + i] = rows[i * dim + d];
  }
  return columns;
}

}  // namespace

class Hdf5File::Impl {
 public:
  explicit Impl(std::filesystem::path path)
      : path_(std::move(path)),
        temporary_(TemporaryNameOf(path_)),
        quiet_(Prepare()),
        links_(Checked(H5Pcreate(H5P_LINK_CREATE)), H5Pclose),
        file_(Create(), H5Fclose) {}

  ~Impl() {
    if (file_ >= 0) file_.CloseNow();
    if (!published_) std::remove(temporary_.c_str());
  }

  bool Add(const std::string& name, const Features& features) {
    if (!Claim(name)) return false;
    if (pictures_.size() == 1) {
      SetText("model_id", features.model_id);
      SetText("generator", "Pliant " PLIANT_VERSION);
    }
    const Handle group(Checked(H5Gcreate2(file_, name.c_str(), links_, H5P_DEFAULT, H5P_DEFAULT)),
                       H5Gclose);
    const std::size_t n = features.keypoints.size();
    std::vector<float> points, scores, scales, oris;
    for (const Keypoint& k : features.keypoints) {
      points.insert(points.end(), {k.x, k.y});
      scores.push_back(k.response);
      scales.push_back(k.size / 2);
      oris.push_back(k.angle);
    }
    const std::array<std::int64_t, 2> size = {features.width, features.height};
    Write(group, "keypoints", H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, {n, 2}, points.data());
    WriteDescriptors(group, features.descriptors);
    Write(group, "scores", H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, {n}, scores.data());
    Write(group, "scales", H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, {n}, scales.data());
    Write(group, "oris", H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, {n}, oris.data());
    Write(group, "image_size", H5T_STD_I64LE, H5T_NATIVE_INT64, {2}, size.data());
    return true;
  }

  void Publish() {
    if (H5Fflush(file_, H5F_SCOPE_GLOBAL) < 0) Fail();
    if (!file_.CloseNow()) Fail();
    if (const std::error_code error = PublishFile(temporary_, path_)) ThrowFailed(error.message());
    published_ = true;
  }

 private:
  // Before anything else is asked of HDF5: no words on standard error, nothing done at the end of
  // the program for a file that could not be written.
  static bool Prepare() {
    H5dont_atexit();
    return H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr) >= 0;
  }

  [[noreturn]] void ThrowFailed(const std::string& why) const {
    throw Error(ErrorCode::kNoSpace, "write_failed",
                ToDisplayText(path_.string()) + " could not be written: " + why);
  }
  [[noreturn]] void Fail() const { ThrowFailed(LastComplaint()); }
  hid_t Checked(hid_t id) const {
    if (id < 0) Fail();
    return id;
  }

  // The file; and how groups are linked into it.
  hid_t Create() const {
    if (H5Pset_create_intermediate_group(links_, 1) < 0 ||
        H5Pset_char_encoding(links_, H5T_CSET_UTF8) < 0) {
      Fail();
    }
    const Handle access(Checked(H5Pcreate(H5P_FILE_ACCESS)), H5Pclose);
    // Groups of 1.8, which hold any number of names, and of any length. Nobody else knows the
    // temporary file: no lock, which some file systems of networks do not have.
    if (H5Pset_libver_bounds(access, H5F_LIBVER_V18, H5F_LIBVER_LATEST) < 0 ||
        H5Pset_file_locking(access, false, true) < 0) {
      Fail();
    }
    return Checked(H5Fcreate(temporary_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access));
  }

  // Notes the name, and the folders that are in it.
  bool Claim(const std::string& name) {
    for (std::size_t at = name.find('/'); at != std::string::npos; at = name.find('/', at + 1)) {
      if (pictures_.contains(name.substr(0, at))) return false;
      folders_.insert(name.substr(0, at));
    }
    return !folders_.contains(name) && pictures_.insert(name).second;
  }

  void SetText(const char* name, const std::string& text) const {
    const Handle type(Checked(H5Tcopy(H5T_C_S1)), H5Tclose);
    if (H5Tset_size(type, H5T_VARIABLE) < 0 || H5Tset_cset(type, H5T_CSET_UTF8) < 0) Fail();
    const Handle single(Checked(H5Screate(H5S_SCALAR)), H5Sclose);
    const Handle attribute(Checked(H5Acreate2(file_, name, type, single, H5P_DEFAULT, H5P_DEFAULT)),
                           H5Aclose);
    const char* value = text.c_str();
    if (H5Awrite(attribute, type, static_cast<const void*>(&value)) < 0) Fail();
  }

  void Write(hid_t group, const char* name, hid_t in_file, hid_t in_memory, const Shape& shape,
             const void* values) const {
    const Handle space(
        Checked(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr)), H5Sclose);
    const Handle data(
        Checked(H5Dcreate2(group, name, in_file, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT)),
        H5Dclose);
    if (H5Dwrite(data, in_memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) < 0) Fail();
  }

  void WriteDescriptors(hid_t group, const Descriptors& d) const {
    const auto dim = static_cast<std::size_t>(d.dim);
    const Shape shape = {dim, d.rows};
    if (d.kind == DescriptorKind::kFloat) {
      const std::vector<float> columns = Columns(d.floats, d.rows, dim);
      Write(group, "descriptors", H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, shape, columns.data());
    } else {
      const std::vector<std::uint8_t> columns = Columns(d.bytes, d.rows, dim);
      Write(group, "descriptors", H5T_STD_U8LE, H5T_NATIVE_UINT8, shape, columns.data());
    }
  }

  const std::filesystem::path path_;
  const std::string temporary_;
  const bool quiet_;
  const Handle links_;
  Handle file_;
  bool published_ = false;
  std::set<std::string> pictures_, folders_;
};

Hdf5File::Hdf5File(std::filesystem::path path) : impl_(std::make_unique<Impl>(std::move(path))) {}
Hdf5File::~Hdf5File() = default;

bool Hdf5File::Add(const std::string& name, const Features& features) {
  return impl_->Add(name, features);
}

void Hdf5File::Publish() { impl_->Publish(); }

}  // namespace pliant::cli
