#include "tests/reference/surfel_reference.h"

#include <algorithm>
#include <cmath>

namespace tsdfpp::reference {

Pose SurfelReference::Object::T_WL() const {
  if (!birth || birth->matrix() == now->matrix()) return Pose::Identity();
  return *now * birth->inverse();
}

void SurfelReference::SetObjectPose(InstanceId id, const Pose& T_WO) {
  Object& object = objects_[id];
  if (!object.birth) object.birth = T_WO;
  object.now = T_WO;
}

std::vector<PlainSurfel> SurfelReference::SurfelsOf(InstanceId id) const {
  const auto object = objects_.find(id);
  return object == objects_.end() ? std::vector<PlainSurfel>{} : object->second.surfels;
}

double SurfelReference::Reach(double z) const { return 0.75 * std::max(h_, z / f_); }

double SurfelReference::RadiusOf(const Pixel& pixel) const {
  return std::min(Reach(pixel.z) + pixel.extent, 4 * h_);
}

std::optional<Eigen::Vector3d> SurfelReference::Meet(const Eigen::Vector3d& ray,
                                                     const Eigen::Vector3d& centre,
                                                     const Eigen::Vector3d& normal) {
  if (normal.dot(centre) >= 0 || normal.dot(ray) >= 0) return std::nullopt;
  return Eigen::Vector3d(normal.dot(centre) / normal.dot(ray) * ray);
}

std::optional<Eigen::Vector3d> SurfelReference::LiesOn(const Pixel& pixel,
                                                       const Eigen::Vector3d& centre,
                                                       const Eigen::Vector3d& normal,
                                                       double radius) const {
  if (!pixel.has_normal || centre.z() < 0.05) return std::nullopt;
  const auto meeting = Meet(pixel.ray, centre, normal);
  if (!meeting || (*meeting - centre).norm() > radius) return std::nullopt;
  if ((*meeting - pixel.point).norm() > h_) return std::nullopt;
  return meeting;
}

std::optional<Eigen::Vector3d> SurfelReference::Step(const std::vector<Pixel>& pixels,
                                                     const Pixel& at, int du, int dv) const {
  const int n = std::max(std::abs(du), std::abs(dv));
  const int u = at.u + du;
  const int v = at.v + dv;
  if (u < 0 || v < 0 || u >= k_.width || v >= k_.height) return std::nullopt;
  const Pixel& to = pixels[static_cast<std::size_t>(v * k_.width + u)];
  if (to.id != at.id || std::abs(to.z - at.z) > 10 * n * at.z / f_) return std::nullopt;
  return Eigen::Vector3d(to.point - at.point);
}

std::vector<SurfelReference::Pixel> SurfelReference::PixelsOf(const Frame& frame,
                                                              const cv::Mat& labels) const {
  std::vector<Pixel> pixels;
  for (int v = 0; v < k_.height; ++v) {
    for (int u = 0; u < k_.width; ++u) {
      Pixel pixel;
      pixel.u = u;
      pixel.v = v;
      const float z = frame.depth.at<float>(v, u);
      if (std::isfinite(z) && z > 0 && z <= 100) pixel.id = labels.at<InstanceId>(v, u);
      pixel.z = static_cast<double>(z);
      pixel.ray = {(u - k_.cx) / k_.fx, (v - k_.cy) / k_.fy, 1};
      pixel.point = pixel.z * pixel.ray;
      pixel.colour = frame.colour.at<cv::Vec3b>(v, u);
      pixels.push_back(pixel);
    }
  }
  for (Pixel& pixel : pixels) {
    if (pixel.id == kNoInstance || pixel.z < 0.05) continue;
    const auto along = [&](int du, int dv) -> std::optional<Eigen::Vector3d> {
      int n = std::min(std::max(static_cast<int>(std::floor(h_ / 2 / (pixel.z / f_))), 1), 8);
      for (; n >= 1; n /= 2) {
        const auto on = Step(pixels, pixel, n * du, n * dv);
        const auto back = Step(pixels, pixel, -n * du, -n * dv);
        if (on && !back) return *on;
        if (back && !on) return Eigen::Vector3d(-*back);
        if (!on) continue;
        if (std::abs(on->z() + back->z()) <= h_ / 2) return Eigen::Vector3d(*on - *back);
        if (std::abs(on->z()) <= std::abs(back->z())) return *on;
        return Eigen::Vector3d(-*back);
      }
      return std::nullopt;
    };
    const auto right = along(1, 0);
    const auto down = along(0, 1);
    if (!right || !down) continue;
    const Eigen::Vector3d normal = down->cross(*right);
    if (normal.norm() == 0 || normal.dot(pixel.ray) >= 0) continue;
    pixel.has_normal = true;
    pixel.normal = normal.normalized().cast<float>().cast<double>();
    const double cosine = -pixel.normal.dot(pixel.ray.normalized());
    pixel.extent = pixel.z / f_ / (std::sqrt(2.0) * std::max(cosine, 0.1));
  }
  return pixels;
}

bool SurfelReference::IsSeenThrough(const std::vector<Pixel>& pixels,
                                    const Eigen::Vector3d& q) const {
  if (q.z() < 0.05) return false;
  const double u = std::floor(k_.fx * q.x() / q.z() + k_.cx + 0.5);
  const double v = std::floor(k_.fy * q.y() / q.z() + k_.cy + 0.5);
  bool middle_is_usable = false;
  for (const Pixel& pixel : pixels) {
    if (pixel.id == kNoInstance) continue;
    if (std::abs(pixel.u - u) > 1 || std::abs(pixel.v - v) > 1) continue;
    if ((pixel.z - q.z()) * pixel.ray.norm() <= h_) return false;
    middle_is_usable = middle_is_usable || (pixel.u == u && pixel.v == v);
  }
  return middle_is_usable;
}

void SurfelReference::Fuse(const Frame& frame, const cv::Mat& labels) {
  ++frames_;
  k_ = frame.intrinsics;
  f_ = std::min(k_.fx, k_.fy);
  std::vector<Pixel> pixels = PixelsOf(frame, labels);

  // Which surfel each pixel is fused with.
  std::vector<const PlainSurfel*> chosen(pixels.size(), nullptr);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    Pixel& pixel = pixels[i];
    if (pixel.id == kNoInstance || !objects_.contains(pixel.id)) continue;
    const Object& object = objects_.at(pixel.id);
    const Pose T_CL = frame.T_WC.inverse() * object.T_WL();
    double least = 0;
    for (const PlainSurfel& surfel : object.surfels) {
      const Eigen::Vector3d centre = T_CL * surfel.centre_L.cast<double>();
      const Eigen::Vector3d normal = T_CL.linear() * surfel.normal_L.cast<double>();
      const auto meeting = LiesOn(pixel, centre, normal, static_cast<double>(surfel.radius_m));
      if (!meeting) continue;
      pixel.lies_on_one = true;
      if (pixel.normal.dot(normal) < std::cos(M_PI / 6)) continue;
      const double apart = (*meeting - centre).norm();
      if (chosen[i] != nullptr && apart >= least) continue;
      chosen[i] = &surfel;
      least = apart;
    }
  }

  for (auto& [id, object] : objects_) {
    const Pose T_CL = frame.T_WC.inverse() * object.T_WL();
    std::vector<PlainSurfel> kept;
    for (const PlainSurfel& old : object.surfels) {
      const Eigen::Vector3d centre = T_CL * old.centre_L.cast<double>();
      const Eigen::Vector3d normal = T_CL.linear() * old.normal_L.cast<double>();
      int count = 0;
      double offset = 0;
      Eigen::Vector3d normals = Eigen::Vector3d::Zero();
      Eigen::Vector3d colours = Eigen::Vector3d::Zero();
      double radius = static_cast<double>(old.radius_m);
      for (std::size_t i = 0; i < pixels.size(); ++i) {
        if (chosen[i] != &old) continue;
        ++count;
        offset += (pixels[i].point - centre).dot(normal);
        normals += pixels[i].normal;
        for (int c = 0; c < 3; ++c) colours[c] += pixels[i].colour[c];
        radius = std::min(radius, RadiusOf(pixels[i]));
      }
      PlainSurfel surfel = old;
      if (count > 0) {
        const double share = 1.0 / (std::min(old.confidence, weight_cap_) + 1);
        surfel.centre_L += (share * offset / count * old.normal_L.cast<double>()).cast<float>();
        const Eigen::Vector3d seen = T_CL.linear().transpose() * normals.normalized();
        surfel.normal_L =
            ((1 - share) * old.normal_L.cast<double>() + share * seen).normalized().cast<float>();
        for (std::size_t c = 0; c < 3; ++c) {
          const double mean = 256 * colours[static_cast<int>(c)] / count;
          surfel.colour[c] =
              static_cast<int>(std::floor((1 - share) * old.colour[c] + share * mean + 0.5));
        }
        surfel.radius_m = static_cast<float>(radius);
        surfel.confidence = std::min(old.confidence + 1, 65535);
      }
      const bool is_late = surfel.confidence < 2 && frames_ - surfel.born >= 10;
      if (is_late || (count == 0 && IsSeenThrough(pixels, centre))) continue;
      kept.push_back(surfel);
    }
    object.surfels = kept;
  }

  for (const Pixel& pixel : pixels) {
    if (pixel.lies_on_one || !pixel.has_normal) continue;
    Object& object = objects_[pixel.id];
    const Pose T_LC = object.T_WL().inverse() * frame.T_WC;
    PlainSurfel surfel;
    surfel.centre_L = (T_LC * pixel.point).cast<float>();
    surfel.normal_L = (T_LC.linear() * pixel.normal).cast<float>();
    surfel.radius_m = static_cast<float>(RadiusOf(pixel));
    for (int c = 0; c < 3; ++c) {
      surfel.colour[static_cast<std::size_t>(c)] = 256 * pixel.colour[c];
    }
    surfel.confidence = 1;
    surfel.born = frames_;
    object.surfels.push_back(surfel);
    for (Pixel& other : pixels) {
      if (other.id != pixel.id || other.lies_on_one) continue;
      other.lies_on_one = LiesOn(other, pixel.point, pixel.normal, Reach(pixel.z)).has_value();
    }
  }
}

std::vector<PlainHit> SurfelReference::Cast(const Intrinsics& camera, const Pose& T_WC, int u,
                                            int v) const {
  const Eigen::Vector3d ray((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
  std::vector<PlainHit> hits;
  for (const auto& [id, object] : objects_) {
    const Pose T_CL = T_WC.inverse() * object.T_WL();
    PlainHit first;
    for (const PlainSurfel& surfel : object.surfels) {
      if (surfel.confidence < 2) continue;
      const Eigen::Vector3d centre = T_CL * surfel.centre_L.cast<double>();
      const Eigen::Vector3d normal = T_CL.linear() * surfel.normal_L.cast<double>();
      const auto meeting = Meet(ray, centre, normal);
      if (!meeting || (*meeting - centre).norm() > static_cast<double>(surfel.radius_m)) continue;
      if (first.id != kNoInstance && meeting->z() >= first.depth) continue;
      first = {id, meeting->z(), T_WC.linear() * normal};
    }
    if (first.id != kNoInstance) hits.push_back(first);
  }
  std::stable_sort(hits.begin(), hits.end(),
                   [](const PlainHit& a, const PlainHit& b) { return a.depth < b.depth; });
  return hits;
}

}  // namespace tsdfpp::reference
