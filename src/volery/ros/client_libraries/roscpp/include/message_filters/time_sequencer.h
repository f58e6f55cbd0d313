// message_filters::TimeSequencer.
#pragma once
#include <map>

#include "message_filters/simple_filter.h"

namespace message_filters {

// Passes messages on in the order of their stamps, each *delay* after its stamp.
template <class Message>
class TimeSequencer : public OneInput<TimeSequencer<Message>, Message> {
public:
    using typename SimpleFilter<Message>::EventType;
    using OneInput<TimeSequencer, Message>::add;
    TimeSequencer(ros::Duration delay, ros::Duration update_rate, std::uint32_t queue_size,
                  ros::NodeHandle node = ros::NodeHandle())
        : delay_(delay), size_(queue_size) {
        timer_ = node.createTimer(update_rate, [this](const ros::TimerEvent&) { dispatch(); });
    }
    template <class Filter>
    TimeSequencer(Filter& filter, ros::Duration delay, ros::Duration update_rate, std::uint32_t queue_size,
                  ros::NodeHandle node = ros::NodeHandle())
        : TimeSequencer(delay, update_rate, queue_size, node) {
        this->connectInput(filter);
    }
    void add(const EventType& event) {
        auto const at = stamp(event);
        if (at < last_) return;
        waiting_.insert({at, event});
        if (size_ != 0 && waiting_.size() > size_) waiting_.erase(waiting_.begin());
    }

private:
    static ros::Time stamp(const EventType& event) {
        return ros::message_traits::TimeStamp<Message>::value(*event.getConstMessage());
    }
    void dispatch() {
        while (!waiting_.empty() && waiting_.begin()->first + delay_ <= ros::Time::now()) {
            auto const next = *waiting_.begin();
            waiting_.erase(waiting_.begin());
            last_ = next.first;
            this->signalMessage(next.second);
        }
    }
    ros::Duration delay_;
    std::size_t size_;
    ros::Time last_;
    std::multimap<ros::Time, EventType> waiting_;
    ros::Timer timer_;
};

}  // namespace message_filters
