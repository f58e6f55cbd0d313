// message_filters: what has an output of messages, and the filters with one input.
#pragma once
#include <algorithm>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "ros/message_traits.h"
#include "ros/node_handle.h"

namespace message_filters {

// A callback that is registered, until it is disconnected.
class Connection {
public:
    Connection() = default;
    explicit Connection(std::function<void()> end) : end_(std::move(end)) {}
    void disconnect() {
        if (end_) std::exchange(end_, nullptr)();
    }

private:
    std::function<void()> end_;
};

namespace detail {

// Callbacks with arguments of the given types, which are called in the order in which they were registered.
template <class... Arguments>
class Calls {
public:
    using Callback = std::function<void(const Arguments&...)>;
    Connection add(Callback callback) {
        auto const made = std::make_shared<Callback>(std::move(callback));
        calls_->push_back(made);
        return Connection([calls = calls_, made] {
            calls->erase(std::remove(calls->begin(), calls->end(), made), calls->end());
        });
    }
    void operator()(const Arguments&... arguments) const {
        auto const calls = *calls_;  // a callback may register or disconnect others
        for (const auto& call : calls) (*call)(arguments...);
    }

private:
    using All = std::vector<std::shared_ptr<Callback>>;
    std::shared_ptr<All> calls_ = std::make_shared<All>();
};

// An event as a callback's parameter: a pointer, a message or an event.
template <class Parameter, class Message>
decltype(auto) argument(const ros::MessageEvent<Message const>& event) {
    using Plain = std::remove_cv_t<std::remove_reference_t<Parameter>>;
    if constexpr (std::is_constructible_v<Plain, ros::MessageEvent<Message const>>)
        return Plain(event);
    else if constexpr (std::is_same_v<Plain, boost::shared_ptr<Message>>)
        return boost::make_shared<Message>(*event.getConstMessage());
    else if constexpr (std::is_same_v<Plain, Message>)
        return static_cast<const Message&>(*event.getConstMessage());
    else
        return event.getConstMessage();
}

}  // namespace detail

template <class Message>
class SimpleFilter {
public:
    using MConstPtr = boost::shared_ptr<Message const>;
    using EventType = ros::MessageEvent<Message const>;
    using Callback = boost::function<void(const MConstPtr&)>;
    using EventCallback = boost::function<void(const EventType&)>;

    SimpleFilter() = default;
    SimpleFilter(const SimpleFilter&) = delete;
    SimpleFilter& operator=(const SimpleFilter&) = delete;

    template <class Function>
    Connection registerCallback(const Function& callback) {
        return calls_.add([callback = Callback(callback)](const EventType& event) { callback(event.getConstMessage()); });
    }
    template <class Parameter>
    Connection registerCallback(const boost::function<void(Parameter)>& callback) {
        return add<Parameter>(callback);
    }
    template <class Parameter>
    Connection registerCallback(void (*callback)(Parameter)) {
        return add<Parameter>(callback);
    }
    template <class Class, class Parameter>
    Connection registerCallback(void (Class::*callback)(Parameter), Class* object) {
        return add<Parameter>([=](Parameter message) { (object->*callback)(message); });
    }
    void setName(const std::string& name) { name_ = name; }
    const std::string& getName() const { return name_; }

protected:
    void signalMessage(const MConstPtr& message) { calls_(EventType(message, ros::Time::now())); }
    void signalMessage(const EventType& event) { calls_(event); }

private:
    template <class Parameter, class Function>
    Connection add(Function callback) {
        return calls_.add([callback](const EventType& event) { callback(detail::argument<Parameter, Message>(event)); });
    }
    detail::Calls<EventType> calls_;
    std::string name_;
};

// A filter with one input. Its add() takes each message of the input.
template <class Self, class Message>
class OneInput : public SimpleFilter<Message> {
public:
    using typename SimpleFilter<Message>::EventType;
    using typename SimpleFilter<Message>::MConstPtr;
    ~OneInput() { input_.disconnect(); }

    template <class Filter>
    void connectInput(Filter& filter) {
        input_.disconnect();
        input_ = filter.registerCallback(
            boost::function<void(const EventType&)>([this](const EventType& event) { self().add(event); }));
    }
    void add(const MConstPtr& message) { self().add(EventType(message, ros::Time::now())); }

private:
    Self& self() { return static_cast<Self&>(*this); }
    Connection input_;
};

template <class Message>
class PassThrough : public OneInput<PassThrough<Message>, Message> {
public:
    using typename SimpleFilter<Message>::EventType;
    using OneInput<PassThrough, Message>::add;
    PassThrough() = default;
    template <class Filter>
    explicit PassThrough(Filter& filter) {
        this->connectInput(filter);
    }
    void add(const EventType& event) { this->signalMessage(event); }
};

// Keeps the last messages, ordered by their stamps.
template <class Message>
class Cache : public OneInput<Cache<Message>, Message> {
public:
    using typename SimpleFilter<Message>::EventType;
    using typename SimpleFilter<Message>::MConstPtr;
    using OneInput<Cache, Message>::add;
    explicit Cache(unsigned int size = 1) { setCacheSize(size); }
    template <class Filter>
    explicit Cache(Filter& filter, unsigned int size = 1) : Cache(size) {
        this->connectInput(filter);
    }
    void setCacheSize(unsigned int size) { size_ = std::max(size, 1U); }
    void add(const EventType& event) {
        while (kept_.size() >= size_) kept_.erase(kept_.begin());
        auto const place = std::find_if(kept_.rbegin(), kept_.rend(),
                                        [&](const EventType& one) { return !(stamp(event) < stamp(one)); });
        kept_.insert(place.base(), event);
        this->signalMessage(event);
    }
    std::vector<MConstPtr> getInterval(const ros::Time& start, const ros::Time& end) const {
        return messages(from(start), until(end));
    }
    // The same with the message before the interval, and the one after it.
    std::vector<MConstPtr> getSurroundingInterval(const ros::Time& start, const ros::Time& end) const {
        auto first = until(start), last = from(end);
        if (first != kept_.begin()) --first;
        if (last != kept_.end()) ++last;
        return messages(first, last);
    }
    MConstPtr getElemBeforeTime(const ros::Time& time) const {
        auto const after = from(time);
        return after == kept_.begin() ? MConstPtr() : std::prev(after)->getConstMessage();
    }
    MConstPtr getElemAfterTime(const ros::Time& time) const {
        auto const after = until(time);
        return after == kept_.end() ? MConstPtr() : after->getConstMessage();
    }
    ros::Time getLatestTime() const { return kept_.empty() ? ros::Time() : stamp(kept_.back()); }
    ros::Time getOldestTime() const { return kept_.empty() ? ros::Time() : stamp(kept_.front()); }

private:
    using Place = typename std::vector<EventType>::const_iterator;
    static ros::Time stamp(const EventType& event) {
        return ros::message_traits::TimeStamp<Message>::value(*event.getConstMessage());
    }
    Place from(const ros::Time& time) const {
        return std::find_if(kept_.begin(), kept_.end(), [&](const EventType& one) { return stamp(one) >= time; });
    }
    Place until(const ros::Time& time) const {
        return std::find_if(kept_.begin(), kept_.end(), [&](const EventType& one) { return stamp(one) > time; });
    }
    static std::vector<MConstPtr> messages(Place first, Place last) {
        std::vector<MConstPtr> found;
        for (; first < last; ++first) found.push_back(first->getConstMessage());
        return found;
    }
    std::vector<EventType> kept_;
    std::size_t size_ = 1;
};

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
