#include "sequence/background_masks.h"

#include <utility>

namespace tsdfpp {
namespace {

class BackgroundSource : public FrameSource {
 public:
  explicit BackgroundSource(std::unique_ptr<FrameSource> source) : source_(std::move(source)) {}
  const SequenceInfo& info() const override { return source_->info(); }
  bool IsSensed() const override { return source_->IsSensed(); }
  Expected<Frame> Read(int index) override { return WithMask(source_->Read(index)); }
  Expected<Frame> ReadTrue(int index) override { return WithMask(source_->ReadTrue(index)); }
  bool HasTruth() const override { return source_->HasTruth(); }
  Expected<std::vector<TrueModel>> Truth() override { return source_->Truth(); }

 private:
  Expected<Frame> WithMask(Expected<Frame> frame) const {
    if (!frame) return frame;
    if (!frame->mask.empty()) {
      return DataError("{}: frame {} has a mask and frame {} has none, expected masks for all",
                       info().name, frame->index, info().first_index);
    }
    frame->mask = cv::Mat(frame->depth.size(), CV_16UC1, cv::Scalar(kBackground));
    return frame;
  }

  std::unique_ptr<FrameSource> source_;
};

}  // namespace

Expected<MaskedSource> WithBackgroundMasks(std::unique_ptr<FrameSource> source) {
  TSDFPP_ASSIGN(const Frame first, source->Read(source->info().first_index));
  if (!first.mask.empty()) return MaskedSource{std::move(source), ""};
  std::string remark =
      fmt::format("{}: has no masks, so all of it is taken for background", source->info().name);
  return MaskedSource{std::make_unique<BackgroundSource>(std::move(source)), std::move(remark)};
}

}  // namespace tsdfpp
