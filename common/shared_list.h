// A list whose copies share their elements: of what is large, and goes from one version of something to the next mostly
// as it is. A value like any other; copies on different threads do not mind each other.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <utility>
#include <vector>

namespace radiosity {

template <typename T>
class SharedList {
 public:
  using Element = std::shared_ptr<const T>;

  class const_iterator {
   public:
    using difference_type = std::ptrdiff_t;
    using value_type = T;
    const_iterator() = default;
    explicit const_iterator(const Element* at) : at_(at) {}
    const T& operator*() const { return **at_; }
    const T* operator->() const { return at_->get(); }
    const_iterator& operator++() {
      ++at_;
      return *this;
    }
    const_iterator operator++(int) { return const_iterator(at_++); }
    bool operator==(const const_iterator&) const = default;

   private:
    const Element* at_ = nullptr;
  };
  using value_type = T;
  using iterator = const_iterator;

  SharedList() = default;
  SharedList(std::initializer_list<T> values) {
    for (const auto& value : values) push_back(value);
  }

  [[nodiscard]] std::size_t size() const { return elements_.size(); }
  [[nodiscard]] bool empty() const { return elements_.empty(); }
  const T& operator[](std::size_t i) const { return *elements_[i]; }
  [[nodiscard]] const T& at(std::size_t i) const { return *elements_.at(i); }
  [[nodiscard]] const T& back() const { return *elements_.back(); }
  [[nodiscard]] const Element& element(std::size_t i) const { return elements_[i]; }
  [[nodiscard]] const_iterator begin() const { return const_iterator(elements_.data()); }
  [[nodiscard]] const_iterator end() const { return const_iterator(elements_.data() + elements_.size()); }

  void push_back(T value) { elements_.push_back(std::make_shared<const T>(std::move(value))); }
  void push_back(Element element) { elements_.push_back(std::move(element)); }
  /// Other lists keep the value that it had.
  template <typename Change>
  void edit(std::size_t i, const Change& change) {
    auto value = std::make_shared<T>(at(i));
    change(*value);
    elements_[i] = std::move(value);
  }

  /// What is shared is the same without a look at it.
  bool operator==(const SharedList& other) const {
    if (size() != other.size()) return false;
    for (std::size_t i = 0; i < size(); ++i) {
      if (elements_[i] != other.elements_[i] && !(*elements_[i] == *other.elements_[i])) return false;
    }
    return true;
  }

 private:
  std::vector<Element> elements_;
};

}  // namespace radiosity
