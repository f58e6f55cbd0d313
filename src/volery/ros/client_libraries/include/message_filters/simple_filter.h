// message_filters: what has an output of messages, and the filters with one input.
#pragma once
#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "message_filters/library.h"

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
decltype(auto) argument(const library::Event<Message>& event) {
    using Plain = std::remove_cv_t<std::remove_reference_t<Parameter>>;
    if constexpr (std::is_constructible_v<Plain, library::Event<Message>>)
        return Plain(event);
    else if constexpr (std::is_same_v<Plain, library::Pointer<Message>>)
        return Plain(new Message(*event.getConstMessage()));
    else if constexpr (std::is_same_v<Plain, Message>)
        return static_cast<const Message&>(*event.getConstMessage());
    else
        return event.getConstMessage();
}

}  // namespace detail

template <class Message>
class SimpleFilter {
public:
    using MConstPtr = library::Pointer<Message const>;
    using EventType = library::Event<Message>;
    using Callback = library::Function<void(const MConstPtr&)>;
    using EventCallback = library::Function<void(const EventType&)>;

    SimpleFilter() = default;
    SimpleFilter(const SimpleFilter&) = delete;
    SimpleFilter& operator=(const SimpleFilter&) = delete;

    template <class Function>
    Connection registerCallback(const Function& callback) {
        return calls_.add([callback = Callback(callback)](const EventType& event) { callback(event.getConstMessage()); });
    }
    template <class Parameter>
    Connection registerCallback(const library::Function<void(Parameter)>& callback) {
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
    void signalMessage(const MConstPtr& message) { calls_(EventType(message, library::now())); }
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
            library::Function<void(const EventType&)>([this](const EventType& event) { self().add(event); }));
    }
    void add(const MConstPtr& message) { self().add(EventType(message, library::now())); }

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
                                        [&](const EventType& one) { return library::stamp<Message>(event) >= library::stamp<Message>(one); });
        kept_.insert(place.base(), event);
        this->signalMessage(event);
    }
    std::vector<MConstPtr> getInterval(const library::Time& start, const library::Time& end) const {
        return messages(from(start), until(end));
    }
    // The same with the message before the interval, and the one after it.
    std::vector<MConstPtr> getSurroundingInterval(const library::Time& start, const library::Time& end) const {
        auto first = until(start), last = from(end);
        if (first != kept_.begin()) --first;
        if (last != kept_.end()) ++last;
        return messages(first, last);
    }
    MConstPtr getElemBeforeTime(const library::Time& time) const {
        auto const after = from(time);
        return after == kept_.begin() ? MConstPtr() : std::prev(after)->getConstMessage();
    }
    MConstPtr getElemAfterTime(const library::Time& time) const {
        auto const after = until(time);
        return after == kept_.end() ? MConstPtr() : after->getConstMessage();
    }
    library::Time getLatestTime() const { return library::time(kept_.empty() ? 0 : library::stamp<Message>(kept_.back())); }
    library::Time getOldestTime() const { return library::time(kept_.empty() ? 0 : library::stamp<Message>(kept_.front())); }

private:
    using Place = typename std::vector<EventType>::const_iterator;
    Place from(const library::Time& time) const {
        auto const at = library::nanoseconds(time);
        return std::find_if(kept_.begin(), kept_.end(),
                            [at](const EventType& one) { return library::stamp<Message>(one) >= at; });
    }
    Place until(const library::Time& time) const {
        auto const at = library::nanoseconds(time);
        return std::find_if(kept_.begin(), kept_.end(),
                            [at](const EventType& one) { return library::stamp<Message>(one) > at; });
    }
    static std::vector<MConstPtr> messages(Place first, Place last) {
        std::vector<MConstPtr> found;
        for (; first < last; ++first) found.push_back(first->getConstMessage());
        return found;
    }
    std::vector<EventType> kept_;
    std::size_t size_ = 1;
};

}  // namespace message_filters
