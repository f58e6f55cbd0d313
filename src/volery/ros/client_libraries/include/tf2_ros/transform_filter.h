// What tf2_ros::MessageFilter of both libraries does: it passes messages on once the transforms at their stamps are known.
#pragma once
#include <limits>
#include <list>

#include "message_filters/simple_filter.h"
#include "tf2/buffer_requests.h"

namespace tf2_ros {

namespace filter_failure_reasons {
enum FilterFailureReason { Unknown, OutTheBack, EmptyFrameID };
}
using FilterFailureReason = filter_failure_reasons::FilterFailureReason;

class MessageFilterBase {
public:
    using V_string = std::vector<std::string>;
    virtual ~MessageFilterBase() = default;
    virtual void clear() = 0;
    virtual void setTargetFrame(const std::string& frame) = 0;
    virtual void setTargetFrames(const V_string& frames) = 0;
    virtual void setTolerance(const message_filters::library::Duration& tolerance) = 0;
};

template <class Message>
class TransformFilter : public MessageFilterBase,
                        public message_filters::OneInput<TransformFilter<Message>, Message> {
    using Input = message_filters::OneInput<TransformFilter, Message>;

public:
    using typename Input::EventType;
    using typename Input::MConstPtr;
    using MEvent = EventType;
    using FailureCallback = message_filters::library::Function<void(const MConstPtr&, FilterFailureReason)>;
    using Input::add;

    // Transforms that come are looked at in the tasks of a group of callbacks. A message waits for *longest_ns* at most.
    TransformFilter(tf2::BufferRequests& buffer, const std::string& target, std::uint32_t queue_size, std::int64_t group,
                    std::int64_t longest_ns = std::numeric_limits<std::int64_t>::max())
        : buffer_(buffer), size_(queue_size), longest_(longest_ns) {
        setTargetFrame(target);
        callable_ = volery::register_callable([this](volery::Reader, volery::Writer&) { check(); });
        watch_ = volery::request("ros.tf_watch", volery::Writer().put(buffer.number_()).put(callable_).put(group)).integer();
    }
    ~TransformFilter() override {
        volery::try_request("ros.close", volery::Writer().put(watch_));
        volery::unregister_callable(callable_);
    }

    void setTargetFrame(const std::string& frame) override { setTargetFrames({frame}); }
    void setTargetFrames(const V_string& frames) override {
        frames_ = frames;
        for (auto& frame : frames_)
            if (!frame.empty() && frame.front() == '/') frame.erase(0, 1);
    }
    std::string getTargetFramesString() const {
        std::string all;
        for (const auto& frame : frames_) all += frame + " ";
        return all;
    }
    // The transforms must be known from the stamp until so much later.
    void setTolerance(const message_filters::library::Duration& tolerance) override {
        tolerance_ = message_filters::library::nanoseconds(tolerance);
    }
    void setQueueSize(std::uint32_t size) { size_ = size; }
    std::uint32_t getQueueSize() const { return static_cast<std::uint32_t>(size_); }
    void clear() override { waiting_.clear(); }
    message_filters::Connection registerFailureCallback(const FailureCallback& callback) {
        return failures_.add(callback);
    }

    void add(const EventType& event) {
        if (frame_of(event).empty()) {
            failures_(event.getConstMessage(), filter_failure_reasons::EmptyFrameID);
            return;
        }
        waiting_.push_back(event);
        check();
        if (size_ == 0 || waiting_.size() <= size_) return;
        auto const oldest = waiting_.front();
        waiting_.pop_front();
        failures_(oldest.getConstMessage(), filter_failure_reasons::Unknown);
    }

private:
    static std::string frame_of(const EventType& event) {
        auto const frame = message_filters::library::frame<Message>(event);
        return !frame.empty() && frame.front() == '/' ? frame.substr(1) : frame;
    }
    // Pass on what can be transformed, and drop what is older than the transforms that the buffer keeps, or has waited
    // too long.
    void check() {
        auto const before = std::exchange(waiting_, {});
        auto const now = message_filters::library::nanoseconds(message_filters::library::now());
        for (const auto& event : before) {
            std::string why;
            if (known(event, why))
                this->signalMessage(event);
            else if (why.find("extrapolation into the past") != std::string::npos)
                failures_(event.getConstMessage(), filter_failure_reasons::OutTheBack);
            else if (now - message_filters::library::nanoseconds(event.getReceiptTime()) > longest_)
                failures_(event.getConstMessage(), filter_failure_reasons::Unknown);
            else
                waiting_.push_back(event);
        }
    }
    bool known(const EventType& event, std::string& why) const {
        auto const stamp = message_filters::library::stamp<Message>(event);
        auto const source = frame_of(event);
        for (const auto& frame : frames_) {
            if (!buffer_.can_transform_(frame, source, stamp, 0, &why)) return false;
            if (tolerance_ != 0 && !buffer_.can_transform_(frame, source, stamp + tolerance_, 0, &why)) return false;
        }
        return true;
    }

    tf2::BufferRequests& buffer_;
    std::size_t size_;
    V_string frames_;
    std::int64_t tolerance_ = 0, longest_;  // ns
    std::list<EventType> waiting_;
    message_filters::detail::Calls<MConstPtr, FilterFailureReason> failures_;
    std::int64_t callable_ = 0, watch_ = 0;
};

}  // namespace tf2_ros
