// Hands on what the microphone hears, in the worklet's blocks of 128 samples.
class Microphone extends AudioWorkletProcessor {
  process([[channel]]) {
    if (channel) this.port.postMessage(channel.slice());
    return true;
  }
}
registerProcessor("microphone", Microphone);
